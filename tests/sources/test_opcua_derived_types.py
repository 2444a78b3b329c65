"""A robot's server by asyncua alone, whose types are a maker's own, derived from those of OPC 40010."""

from __future__ import annotations

import math

from foreign_opcua import URI, foreign_opcua
from seerob.devices.sources.opcua_robot import OpcuaRobot
from seerob.protocols.plc.opcua_robotics import AXIS, DEVICE, DEVICES, ROBOTICS, SYSTEM
from sources.listening import heard

UNIT_DEG, UNIT_GRAM = 17476, 4674125
"""UnitIds of the degree and the gram, UNECE's DD and GRM."""
Q = (0.1, -0.2, 0.3)


def made(server):
    """A cell with one robot of three axes, and with the templates that some servers keep beside them."""
    from asyncua import ua

    own, robotics, di = (server.register_namespace(uri) for uri in (URI, ROBOTICS, DEVICES))

    def derived(number, name):
        of_the_standard = ua.NodeId(number, robotics)
        base = server.nodes.base_object_type.add_object_type(of_the_standard, f"{robotics}:{name}")
        return base.add_object_type(own, f"Maker{name}").add_object_type(own, f"Newer{name}").nodeid

    system, device, axis = (
        derived(*pair) for pair in ((SYSTEM, "System"), (DEVICE, "Device"), (AXIS, "Axis"))
    )
    cell = server.nodes.objects.add_object(di, "DeviceSet").add_object(own, "Cell", objecttype=system)
    devices = cell.add_object(robotics, "MotionDevices")
    devices.add_object(own, "<MotionDeviceIdentifier>", objecttype=device)
    devices.add_object(own, "Camera")
    arm = devices.add_object(own, "ARM-7", objecttype=device)
    mass = arm.add_object(robotics, "FlangeLoad").add_variable(robotics, "Mass", 2500.0)
    mass.add_property(0, "EngineeringUnits", ua.EUInformation("", UNIT_GRAM))
    axes = arm.add_object(robotics, "Axes")
    for name, q in (("<AxisIdentifier>", 0.0), *((f"A{k}", q) for k, q in enumerate(Q))):
        parameters = axes.add_object(own, name, objecttype=axis).add_object(di, "ParameterSet")
        position = parameters.add_variable(robotics, "ActualPosition", math.degrees(q))
        position.add_property(0, "EngineeringUnits", ua.EUInformation("", UNIT_DEG))


def test_types_that_a_maker_derived_are_those_of_the_standard_and_templates_are_nobody():
    with foreign_opcua({}, more=made) as (url, _):
        source = OpcuaRobot(robot="arm", url=url)
        samples = heard(source, lambda said: len(said) > 2 and said[-1].payload is not None)
    assert samples[-1].payload == 2.5
    assert samples[-1].q == tuple(math.radians(math.degrees(q)) for q in Q)
