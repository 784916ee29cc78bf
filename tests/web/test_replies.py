import asyncio
import sqlite3

import pytest

from lipmotion.errors import ExportError, InputError
from lipmotion_studio.web.replies import ERRORS


@pytest.mark.parametrize("kind", [ExportError, OSError, MemoryError, sqlite3.OperationalError, InputError])
def test_a_full_disk_or_memory_is_a_refusal_that_says_nothing_of_the_machine(kind):
    handler = next(ERRORS[each] for each in kind.__mro__ if each in ERRORS)
    reply = asyncio.run(handler(None, kind("/home/ann: no space left")))  # type: ignore[arg-type]
    assert reply.status_code == (422 if kind is InputError else 503)
    assert (b"/home" in reply.body) == (kind is InputError)
