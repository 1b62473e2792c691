from __future__ import annotations

from ipaddress import ip_address, ip_network

import pytest

from mavproxy_uavapi.core.roles import Role
from mavproxy_uavapi.files.tokens import Token
from mavproxy_uavapi.http.callers.caller import Caller, address_of, group_of


@pytest.mark.parametrize(
    ("remote", "address"),
    [
        ("192.0.2.7", "192.0.2.7"),
        ("::ffff:192.0.2.7", "192.0.2.7"),
        ("fe80::1%eth0", "fe80::1"),
        ("2001:db8::1", "2001:db8::1"),
    ],
)
def test_address_is_as_it_is_however_it_is_written(remote: str, address: str) -> None:
    assert address_of(remote) == ip_address(address)


@pytest.mark.parametrize("remote", [None, "", "a path of a socket"])
def test_peer_without_an_address_has_none(remote: str | None) -> None:
    assert address_of(remote) is None
    assert not Caller(address_of(remote)).is_local


def test_one_network_of_ipv6_is_one_caller() -> None:
    neighbours = {group_of(ip_address(f"2001:db8:0:1::{last}")) for last in ("1", "2", "ffff:1")}
    assert neighbours == {"2001:db8:0:1::/64"}
    assert group_of(ip_address("2001:db8:0:2::1")) not in neighbours
    assert group_of(ip_address("192.0.2.7")) != group_of(ip_address("192.0.2.8"))


def test_this_machine_is_one_caller_at_any_address_of_the_loopback() -> None:
    assert len({group_of(ip_address(own)) for own in ("127.0.0.1", "127.1.2.3", "::1")}) == 1


def test_limits_count_each_token_and_each_address_apart() -> None:
    anna = Token("anna", Role.FLY, frozenset(), b"")
    callers = [
        Caller(ip_address(address), token=token) for address in ("127.0.0.1", "192.0.2.7") for token in (None, anna)
    ]
    assert len({caller.counted_as for caller in callers}) == 4


def test_what_a_proxy_passed_on_is_from_nowhere_that_is_known() -> None:
    loopback = ip_address("127.0.0.1")
    assert Caller(loopback).is_local and Caller(loopback).is_in([ip_network("127.0.0.0/8")])
    forwarded = Caller(loopback, forwarded=True)
    assert not forwarded.is_local and not forwarded.is_in([ip_network("127.0.0.0/8")])
