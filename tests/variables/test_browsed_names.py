"""A dictionary that is made by browsing is read back, whatever a device calls its variables."""

import re
import tomllib

import msgspec

from seerob.app.commands.variables import skeleton
from seerob.devices.sources.mqtt import Metric, Plain, _nodes, address
from seerob.protocols.plc import sparkplug
from seerob.workstation.variables import Variable


def test_what_is_browsed_is_an_address_whatever_its_name():
    metrics = tuple(sparkplug.Metric(name=n, value=1.0, type=10) for n in ('a"b', "c\\d", "e\x7f\n"))
    birth = sparkplug.encode(sparkplug.Payload(metrics=metrics))
    messages = (
        ('spBv1.0/g"/DBIRTH/e\\/d', birth),
        ("spBv1.0/g/NBIRTH/e", b"\xff\xff"),  # one who speaks nonsense does not hide the others
        ('{ x = "1" }', b"1"),
        ('a"b', b"1"),
    )
    nodes = [node for topic, payload in messages for node in _nodes(topic, payload)]
    text = re.sub(r"# unit = …", 'unit = "1"  #', skeleton(nodes, 'pl"c'))
    found = [address(msgspec.convert(v, Variable)) for v in tomllib.loads(text)["variables"]]
    assert found == [
        *(Metric(node='g"/e\\', device="d", metric=m.name) for m in metrics),
        Plain('{ x = "1" }'),
        Plain('a"b'),
    ]
