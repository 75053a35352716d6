"""Freed memory that stays with the process."""

from __future__ import annotations

import ctypes

import pytest

from wamnet.kernels import memory


def test_glibc_takes_both_thresholds():
    if not hasattr(ctypes.CDLL(None), "gnu_get_libc_version"):
        pytest.skip("the C library is not glibc: nothing to set")
    assert memory.keep_freed_memory()


def test_other_c_libraries_are_left_alone(monkeypatch):
    monkeypatch.setattr(ctypes, "CDLL", lambda name: object())
    assert not memory.keep_freed_memory()
