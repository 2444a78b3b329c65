"""The maker's shapes on the library's figures."""

from __future__ import annotations

from seerob.model_io.description import Description


def with_geometry_of(robot: Description, maker: Description) -> Description:
    """``robot`` with the shapes of ``maker``."""
    raise NotImplementedError
