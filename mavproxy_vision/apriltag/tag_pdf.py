"""A printable tag: a PDF to scale. Pure, without any library: a tag is black squares."""

from __future__ import annotations

from mavproxy_uavapi.core.errors import SettingError
from mavproxy_vision.apriltag.families import marker_image
from mavproxy_vision.apriltag.tag_layout import FAMILIES, require_id, require_size

POINTS_PER_METRE = 72 / 0.0254
PAPER = {"A4": (0.210, 0.297), "A3": (0.297, 0.420), "A2": (0.420, 0.594), "A1": (0.594, 0.841), "A0": (0.841, 1.189)}
MARGIN = 0.008  # m, the white margin of printers


def tag_pdf(family: str, number: int, size: float) -> bytes:
    """A PDF page with the tag, whose black square has a side of `size` m, on the smallest paper that holds it.

    Raises:
        SettingError: there is no such tag, or it fits no paper.
    """
    if family not in FAMILIES:
        raise SettingError(f"family {family!r} is not one of {', '.join(FAMILIES)}", "family")
    require_id("id", family, number)
    require_size("size", size)
    cells = FAMILIES[family][0]
    bordered_size = size * (cells + 2) / cells  # with the white border, which is one cell wide
    for name, (width, height) in PAPER.items():
        if bordered_size + 2 * MARGIN <= width:
            return _page(family, number, size, (name, width, height))
    raise SettingError(f"a tag of {size:g} m needs {bordered_size:.2f} m with its border: wider than A0", "size")


def _page(family: str, number: int, size: float, paper: tuple[str, float, float]) -> bytes:
    name, width, height = paper
    cells = FAMILIES[family][0]
    image = marker_image(family, number, pixels_per_cell=1, border=1)[1:-1, 1:-1]
    cell = size / cells * POINTS_PER_METRE
    left = (width - size) / 2 * POINTS_PER_METRE
    top = (height + size) / 2 * POINTS_PER_METRE
    drawing = ["0 g"]
    for row in range(cells):
        for column in range(cells):
            if image[row, column] == 0:
                x, y = left + column * cell, top - (row + 1) * cell
                drawing.append(f"{x:.4f} {y:.4f} {cell + 0.02:.4f} {cell + 0.02:.4f} re f")
    text = (
        f"AprilTag {family} id {number}: black square {size * 1000:g} mm. Print on {name} at 100 %; keep the border. "
        "This side is the tag's bottom"
    )
    below = top - size * POINTS_PER_METRE - 2 * cell
    drawing.append(f"BT /F1 9 Tf {left:.2f} {max(below, 12.0):.2f} Td ({text}) Tj ET")
    return _document(width * POINTS_PER_METRE, height * POINTS_PER_METRE, "\n".join(drawing).encode())


def _document(width: float, height: float, drawing: bytes) -> bytes:
    objects = [
        b"<< /Type /Catalog /Pages 2 0 R >>",
        b"<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
        f"<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {width:.4f} {height:.4f}] /Contents 4 0 R "
        f"/Resources << /Font << /F1 5 0 R >> >> >>".encode(),
        b"<< /Length %d >>\nstream\n%s\nendstream" % (len(drawing), drawing),
        b"<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>",
    ]
    out = bytearray(b"%PDF-1.4\n")
    places = []
    for number, body in enumerate(objects, start=1):
        places.append(len(out))
        out += b"%d 0 obj\n%s\nendobj\n" % (number, body)
    start = len(out)
    out += b"xref\n0 %d\n0000000000 65535 f \n" % (len(objects) + 1)
    out += b"".join(b"%010d 00000 n \n" % place for place in places)
    out += b"trailer\n<< /Size %d /Root 1 0 R >>\nstartxref\n%d\n%%%%EOF\n" % (len(objects) + 1, start)
    return bytes(out)
