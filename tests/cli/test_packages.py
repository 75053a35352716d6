"""Test of the sentence for a package that is not installed."""

import sys

import pytest

from wamnet.cli.common.packages import need
from wamnet.refimpl.errors import InputError


@pytest.mark.parametrize(("package", "install"), [((), r"'wamnet\[full\]'"), (("no-such",), "no-such")])
def test_a_missing_package_is_named_with_the_command_that_installs_it(package, install) -> None:
    text = rf"'no_such_package': missing, and needed to fly \(install it: pip install {install}"
    with pytest.raises(InputError, match=text):
        need("no_such_package", "to fly", *package)


def test_a_package_that_is_there_is_returned() -> None:
    """Also a module inside a package."""
    assert need("os.path", "to test").sep == "/"


def test_an_interrupt_waits_until_a_module_is_imported(tmp_path, monkeypatch) -> None:
    """Modules in C++ end the process by SIGABRT if one reaches them: pyopencl's did."""
    (tmp_path / "interrupting.py").write_text(
        "import signal\nsignal.raise_signal(signal.SIGINT)\nwhole = True\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(KeyboardInterrupt):
        need("interrupting", "to test")
    assert sys.modules.pop("interrupting").whole
