"""Trusted certificates are read once per server, and again when their file is another."""

import os
import ssl

import certifi
import pytest

from seerob.protocols.links.credentials import trusting

END = "-----END CERTIFICATE-----\n"


@pytest.fixture
def two():
    with open(certifi.where(), encoding="utf-8") as file:
        first, second, *_ = file.read().split(END)
    return tuple(ssl.PEM_cert_to_DER_cert(pem[pem.index("-----BEGIN") :] + END) for pem in (first, second))


def test_a_file_is_read_once_until_it_changes(tmp_path, two):
    path = tmp_path / "ca.pem"
    path.write_text(ssl.DER_cert_to_PEM_cert(two[0]))
    found = trusting(path, server="https://plc")
    assert found.get_ca_certs(binary_form=True) == [two[0]]
    assert trusting(path, server="https://plc") is found
    assert trusting(path, server="https://other") is not found
    path.write_text(ssl.DER_cert_to_PEM_cert(two[1]))
    os.utime(path, ns=(0, 0))
    assert trusting(path, server="https://plc").get_ca_certs(binary_form=True) == [two[1]]


def test_whoever_the_system_trusts_is_trusted_where_no_file_is_given():
    found = trusting(None, server="https://plc")
    assert found.verify_mode is ssl.CERT_REQUIRED
    assert found.check_hostname
    assert trusting(None, server="https://plc") is found


def test_a_file_that_is_none_is_an_os_error_each_time(tmp_path):
    with pytest.raises(FileNotFoundError):
        trusting(tmp_path / "ca.pem", server="https://plc")
    (tmp_path / "ca.pem").write_text("nothing")
    for _ in range(2):
        with pytest.raises(ssl.SSLError):
            trusting(tmp_path / "ca.pem", server="https://plc")
