"""Keeps what native libraries write to stderr away from the pilot's prompt."""

from __future__ import annotations

import contextlib
import os
import re
import tempfile
import threading
from collections.abc import Iterator

STDERR = 2
# libjpeg, libpng and libtiff have no other way to warn of a damaged picture; the caller notices what matters itself.
OF_LIBRARIES = re.compile(
    rb"libpng |Corrupt JPEG|Premature end|JPEG|Invalid SOS|Unsupported marker|Inconsistent progression"
    rb"|Application transferred|Warning: |TIFF|Quantization table|Huffman table|Bogus|Empty input file|Invalid "
)
_turn = threading.Lock()


@contextlib.contextmanager
def without_native_warnings() -> Iterator[None]:
    """Within the context lines of the picture libraries are dropped; what else comes is written at its end.

    The whole process shares stderr, so one thread at a time is inside, and should not be for long.
    """
    with _turn, contextlib.ExitStack() as undo:
        try:
            terminal = os.dup(STDERR)
        except OSError:  # there is no stderr
            yield
            return
        undo.callback(os.close, terminal)
        kept = undo.enter_context(tempfile.TemporaryFile())
        os.dup2(kept.fileno(), STDERR)
        try:
            yield
        finally:
            os.dup2(terminal, STDERR)
            kept.seek(0)
            for line in kept:
                if not OF_LIBRARIES.match(line):
                    os.write(STDERR, line)
