"""``seerob emulate ros_tcp``: Unity's ROS-TCP-Endpoint beside a robot, or a Unity project that plays one."""

from __future__ import annotations

import argparse

from seerob.app.console.terminal import port
from seerob.app.emulating import Emulated
from seerob.app.emulating._motions import add_motion, home_of, motion_of, target_of

HELP = "Unity's ROS-TCP-Endpoint with the joint states of a robot, or a Unity project that publishes them"


def add(sub: argparse.ArgumentParser) -> None:
    """Arguments."""
    sub.add_argument("--robot", default="ur10", help="robot of the library (default: ur10)")
    add_motion(sub)
    sub.add_argument("--port", type=port, default=10000, help="port of the endpoint (default: 10000)")
    text = "connect to an endpoint at this address, as a Unity project does; else be the endpoint"
    sub.add_argument("--unity", metavar="HOST", help=text)
    text = "of ROS (default: 1); as a Unity project what the endpoint says"
    sub.add_argument("--ros", choices=("1", "2"), default="1", help=text)
    sub.add_argument("--rate", type=float, default=100.0, help="messages per second (default: 100)")


def emulated(options: argparse.Namespace) -> Emulated:
    """The endpoint, or the project.

    Raises:
        InputError: No such robot, a motion that it cannot do, or a rate that nobody sends.
    """
    from seerob.app.emulators.motions import SWING
    from seerob.app.emulators.ros_tcp import RosTcpEndpoint, UnityProject
    from seerob.core.errors import InputError
    from seerob.protocols.ros.ros_serialised import Edition

    if not 1 <= options.rate <= 1000:
        raise InputError.at("seerob emulate", "--rate", f"{options.rate:g} Hz", "it does 1 to 1000 Hz")
    if options.unity and not options.port:
        raise InputError.at("seerob emulate", "--port", "0 with --unity", "name the endpoint's port")
    target = target_of(options.robot)
    motion, what = motion_of(options, target, home_of(target, SWING))
    make = UnityProject if options.unity else RosTcpEndpoint
    server = make(
        motion,
        target.joints,
        host=options.unity or options.host,
        port=options.port,
        edition=Edition(f"ros{options.ros}"),
        rate=options.rate,
    )
    role = "a Unity project, " if options.unity else ""
    hear = ("seerob probe ros_tcp --set side=endpoint --port {port}",) if options.unity else ()
    return Emulated(server, f"{role}{target.name}, {what}", f"{server.host}:{server.port}", hear)
