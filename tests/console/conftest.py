"""What every test of the commands needs."""

import signal

import pytest


@pytest.fixture(autouse=True)
def ctrl_c_is_not_ignored():
    """Workers of pytest may ignore SIGINT, and what they start would as well."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    signal.signal(signal.SIGINT, before)
