import socket

import pytest

from cli.conftest import is_one_error
from lipmotion.storage.files import lock_folder

pytest.importorskip("uvicorn", reason="the extra 'studio' is not installed")


def test_what_the_studio_refuses(here, run):
    assert is_one_error(run("studio", "nothing.wav"), 3)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        assert is_one_error(run("studio", "--port", taken.getsockname()[1], "-o", "project"), 3)
    with lock_folder(here / "project"):  # as by another studio
        assert is_one_error(run("studio", "-o", "project"), 7)
    (here / "project" / "project.json").write_text("{}", encoding="utf-8")
    assert is_one_error(run("studio", "project"), 3)
