"""Packages that only some users need: which extra of the wheel brings each, and what to say without it."""

from __future__ import annotations

from contextlib import suppress
from importlib import import_module

from seerob.core.errors import InputError, Problem

EXTRAS = {
    "asyncua": "opcua",
    "aiomqtt": "mqtt",
    "pymodbus": "modbus",
    "httpx": "web",
    "rosbags": "ros",
    "cbor2": "ros",
    "zenoh": "zenoh",
    "ruckig": "waypoints",
    "ruamel.yaml": "waypoints",
    "scipy": "waypoints",
    "toppra": "permissible",
    "matplotlib": "data",
    "pandas": "data",
    "pyarrow": "data",
    "anywidget": "notebook",
    "coacd": "contacts",
    "openvr": "vive",
    "xr": "openxr",
    "cryptography": "tls",
    "segno": "tls",
    "OCP": "cad",
    "robot_descriptions": "robots",
    "pxr": "usd",
    "cv2": "camera",
    "weasyprint": "print",
}
"""Package as it is imported → the extra that brings it."""


def edition(*names: str) -> str | None:
    """Which of these distributions is installed, with its version, unimported; None where none is."""
    from importlib.metadata import PackageNotFoundError, version  # and with it email, which few need

    for name in names:
        with suppress(PackageNotFoundError):
            return f"{name} {version(name)}"
    return None


class MissingPackage(InputError):
    """A package of an extra is not installed: ``this needs pymodbus: pip install 'seerob[modbus]'``."""

    def __init__(self, package: str) -> None:
        self.package = package
        super().__init__(Problem("", "", f"this needs {package}: pip install 'seerob[{EXTRAS[package]}]'"))


def need(*modules: str) -> None:
    """Check that what an extra brings is installed; modules that none brings are passed over.

    Args:
        modules: Packages of `EXTRAS`, or modules in them: ``pymodbus.client``.

    Raises:
        MissingPackage: The first that is not.
    """
    for module in modules:
        package = next((p for p in EXTRAS if f"{module}.".startswith(f"{p}.")), None)
        if package is None:
            continue
        try:
            import_module(package)
        except ModuleNotFoundError as error:
            if error.name is None or not f"{package}.".startswith(f"{error.name}."):
                raise  # it is there, and lacks something itself
            raise MissingPackage(package) from error
