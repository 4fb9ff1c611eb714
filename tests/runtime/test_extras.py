"""Optional packages: what is there is returned, what is not is named with how to install it."""

import sys

import pytest

from ridgebayes.errors import InputError
from ridgebayes.runtime.extras import extra


def test_extra__returns_a_module_of_a_package():
    assert extra("json.decoder", "none", "") is sys.modules["json.decoder"]


def test_extra__says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    message = r"\At\.xlsx: needs openpyxl: pip install 'ridgebayes\[excel\]'\Z"
    with pytest.raises(InputError, match=message):
        extra("openpyxl", "excel", "t.xlsx: needs openpyxl")
