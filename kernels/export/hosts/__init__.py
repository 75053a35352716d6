"""Hosts: the smallest whole program around an export, for hosts that nobody here wrote.

1. A host is a row of hosts.json: the target whose kernels it runs, how it is started, and how much its own
   storage may add to a kernel's error [host.py]; its files are those of a folder [files/].
2. They are copied as they are. They read `manifest.json`, or, where a language has no reader of JSON, a
   header that says the same [headers.py].
3. Every host runs all kernels on the check pair, compares, and ends with one line and a status, or with a
   page that shows both.
"""
