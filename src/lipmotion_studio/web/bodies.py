"""Bodies of requests: bounded in size and in time."""

from __future__ import annotations

import asyncio
import io
from typing import IO, Any

from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request

from lipmotion.storage.json_text import from_json

LARGEST_JSON_BYTES = 1 << 14
BODY_S = 10.0
"""How long the body of a request may take to arrive."""


async def json_of(request: Request, largest: int = LARGEST_JSON_BYTES) -> Any:
    """Return the JSON that a request brings. Raises HTTPException: something else, too much, or too slowly."""
    if request.headers.get("content-type", "").partition(";")[0].strip().lower() != "application/json":
        raise HTTPException(415, "required application/json")  # which no other site's page can send unasked
    try:
        return from_json((await body_of(request, largest, BODY_S)).decode("utf-8"))
    except ValueError as error:
        raise HTTPException(400, "not JSON in UTF-8") from error


async def body_of(request: Request, largest: int, within_s: float) -> bytes:
    """Return the body of a request. Raises HTTPException: more than ``largest`` bytes, too slow, or broken off."""
    file = io.BytesIO()
    await write_body(request, file, largest, within_s)
    return file.getvalue()


async def write_body(request: Request, file: IO[bytes], largest: int, within_s: float) -> None:
    """Write the body of a request into a file. Raises as ``body_of``."""
    try:
        await asyncio.wait_for(_write(request, file, largest), within_s)
    except (TimeoutError, asyncio.TimeoutError) as error:
        raise HTTPException(408, "the request came too slowly") from error
    except ClientDisconnect as error:
        raise HTTPException(400, "the request broke off") from error


async def _write(request: Request, file: IO[bytes], largest: int) -> None:
    size = 0
    async for part in request.stream():
        size += len(part)
        if size > largest:
            raise HTTPException(413, f"required at most {largest} bytes", {"connection": "close"})
        file.write(part)
