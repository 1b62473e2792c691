"""Exports readings: JSON and CSV page by page, Parquet through a temporary file."""

from __future__ import annotations

import asyncio
import csv
import io
import json
import tempfile
from collections.abc import AsyncIterator, Iterable, Sequence
from datetime import datetime, timezone
from typing import Any, BinaryIO

from mavproxy_gradys.forwarding.quantities import POSITION
from mavproxy_gradys.station.fleet import place_of
from mavproxy_gradys.station.reading_row import COLUMNS, number_of
from mavproxy_gradys.station.store import StoreCounts

Chunks = AsyncIterator[Sequence[tuple[Any, ...]]]
FORMULA = ("=", "+", "-", "@", "\t", "\r")  # a spreadsheet evaluates a text that begins with one of these
PLACE = ("lat", "lon", "relative_alt")  # of a position, as the tables of a flight have it (docs/data.md)
QUANTITY, NOWHERE = COLUMNS.index("quantity"), (None, None, None)
VALUE, TIMES = COLUMNS.index("value"), [COLUMNS.index(name) for name in ("time", "received")]


class ParquetMissing(Exception):
    """pyarrow is not installed."""


def csv_text(rows: Iterable[Sequence[Any]]) -> bytes:
    """Rows as CSV."""
    text = io.StringIO()
    csv.writer(text).writerows([csv_cell(cell) for cell in row] for row in rows)
    return text.getvalue().encode("utf-8", "replace")  # JSON may have unpaired surrogates, which UTF-8 cannot encode


def csv_cell(cell: Any) -> Any:
    """A cell; a text that looks like a formula gets an apostrophe."""
    if isinstance(cell, list | dict):
        return json.dumps(cell)
    return f"'{cell}" if isinstance(cell, str) and cell.startswith(FORMULA) else cell


async def csv_readings(chunks: Chunks) -> AsyncIterator[bytes]:
    """Rows of COLUMNS and PLACE as CSV, with headings."""
    yield csv_text([(*COLUMNS, *PLACE)])
    async for rows in chunks:
        values = [json.loads(row[VALUE]) for row in rows]
        yield csv_text(
            (*row[:VALUE], value, *row[VALUE + 1 :], *place_in(row, value))
            for row, value in zip(rows, values, strict=True)
        )


def place_in(row: Sequence[Any], value: Any) -> tuple[float | None, ...]:
    """Latitude, longitude (degrees) and m above home of a row with that value; None each if it is no position."""
    return place_of(value) if row[QUANTITY] == POSITION else NOWHERE


async def json_readings(chunks: Chunks, counts: StoreCounts) -> AsyncIterator[bytes]:
    """Rows of COLUMNS as one JSON object, with the counts of the store."""
    separator = f'{{"count": {counts.stored}, "repeats": {counts.repeats}, "readings": ['
    async for rows in chunks:
        texts = [json_reading(row) for row in rows]
        yield (separator + ", ".join(texts)).encode()
        separator = ", "
    yield (("" if separator == ", " else separator) + "]}").encode()


def json_reading(row: Sequence[Any]) -> str:
    """A row of COLUMNS as a JSON object; the store has its value as JSON."""
    cells = [cell if n == VALUE else json.dumps(cell) for n, cell in enumerate(row)]
    return "{" + ", ".join(f'"{name}": {cell}' for name, cell in zip(COLUMNS, cells, strict=True)) + "}"


async def parquet_readings(chunks: Chunks) -> BinaryIO:
    """Rows of COLUMNS, a column `number`, and PLACE as a Parquet file, positioned at its beginning.

    Raises:
        ParquetMissing: pyarrow is not installed.
    """
    try:
        import pyarrow  # noqa: PLC0415  an extra
        from pyarrow import parquet  # noqa: PLC0415
    except ModuleNotFoundError as missing:
        raise ParquetMissing("Parquet needs pyarrow: pip install 'mavproxy-uavapi[parquet]'") from missing
    moment = pyarrow.timestamp("us", tz="UTC")
    types = {"seq": pyarrow.int64(), "time": moment, "received": moment}
    names = [*((name, types.get(name, pyarrow.string())) for name in COLUMNS)]
    schema = pyarrow.schema([*names, *((name, pyarrow.float64()) for name in ("number", *PLACE))])
    file = tempfile.TemporaryFile()  # noqa: SIM115  the caller closes it
    try:
        with parquet.ParquetWriter(file, schema, compression="zstd") as writer:
            async for rows in chunks:
                columns = list(zip(*map(parquet_row, rows), strict=True))
                table = pyarrow.table(dict(zip(schema.names, map(list, columns), strict=True)), schema)
                await asyncio.get_running_loop().run_in_executor(None, writer.write_table, table)
        file.seek(0)
    except BaseException:
        file.close()
        raise
    return file


def parquet_row(row: Sequence[Any]) -> tuple[Any, ...]:
    """A row of COLUMNS with its times as datetimes, its number, and its place."""
    cells = [datetime.fromtimestamp(cell, timezone.utc) if n in TIMES else cell for n, cell in enumerate(row)]
    value = json.loads(row[VALUE])
    return (*cells, number_of(value), *place_in(row, value))
