"""Ports that nothing listens at."""

import socket


def free_ports() -> dict[str, int]:
    """Return one of each emulated device: two of TCP, one of UDP."""
    with (
        socket.create_server(("127.0.0.1", 0)) as a,
        socket.create_server(("127.0.0.1", 0)) as b,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as c,
    ):
        c.bind(("127.0.0.1", 0))
        names = ("adapter", "receiver", "sensor")
        return {n: s.getsockname()[1] for n, s in zip(names, (a, b, c), strict=True)}
