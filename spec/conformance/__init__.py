"""Conformance: vectors that the reference has made, and a runner that holds any program to them."""
