"""Damage inside containers that stay whole: safetensors, NumPy, ZIP and PNG."""

import io
import json
import re
import struct
import zipfile
import zlib
from random import Random

from fuzz.edits.byte_edits import BYTE_EDITS, BytesEdit
from fuzz.edits.json_edits import JSON_EDITS, is_json
from fuzz.edits.stream_edits import (
    edit_glb_document,
    edit_gzip,
    edit_ply_row,
    edit_zstd_column,
)
from fuzz.edits.tensor_edits import odd_tensor

DTYPES = (
    *("BOOL", "U8", "I8", "I16", "U16", "F16", "BF16", "I32", "U32", "F32", "F64", "I64", "U64"),
    *("F8_E4M3", "F8_E5M2", "F8_E8M0", "F4", "C64", "X9"),
)
DESCRIPTIONS = (
    *("<f8", ">f8", "<f4", "<f2", "|u1", "<u2", "<i8", "<c16", "|O", "<U5", "|V8", "|b1", "<m8"),
    *("<f16", "f999999999999", "", "(3,)<f4", "f4,f4", "<f8" * 300),
)
SHAPES = (
    *("()", "(0,)", "(1,)", "(3, 5)", "(-1, 3)", "(4000000000, 4)", "(10, 17)", "(2, 2, 3)"),
    *("(9223372036854775807,)", f"({'9' * 5000},)", "(" * 300 + ")" * 300, "(1.5,)", "[3]", "(3"),
    *("(100000, 100000, 3)", "(0, 99999999999999999999)", "('a',)"),
)
_FIELD = re.compile(rb"'(descr|shape)': *('[^']*'|\([^)]*\))")


def edit_dtype(content: bytes, rng: Random) -> bytes:
    """Safetensors: a tensor of another dtype, with a shape that fits its bytes."""
    header, data = _split(content)
    name = rng.choice([key for key in header if key != "__metadata__"])
    entry = header[name]
    entry["dtype"] = rng.choice(DTYPES)
    start, end = entry["data_offsets"]
    bits = {"64": 64, "32": 32, "16": 16}.get(entry["dtype"][-2:], 8)
    count = (end - start) * 8 // bits
    known = 1
    for side in entry["shape"][1:]:
        known *= side
    if rng.random() < 0.7 and known and count % known == 0:
        entry["shape"] = [count // known, *entry["shape"][1:]]
    return _joined(header, data)


def edit_header(content: bytes, rng: Random) -> bytes:
    """Safetensors: any JSON edit of the header."""
    header, data = _split(content)
    text = rng.choice(list(JSON_EDITS.values()))(json.dumps(header).encode(), rng)
    return len(text).to_bytes(8, "little") + text + data


def edit_metadata(content: bytes, rng: Random) -> bytes:
    """Safetensors: an edit of one text of the metadata, mostly inside its JSON."""
    header, data = _split(content)
    texts = header.get("__metadata__") or {}
    if not texts:
        return edit_header(content, rng)
    key = rng.choice(sorted(texts))
    inner = texts[key].encode()
    edits = JSON_EDITS if is_json(inner) and rng.random() < 0.8 else BYTE_EDITS
    texts[key] = rng.choice(list(edits.values()))(inner, rng).decode(errors="replace")
    return _joined(header, data)


def edit_tensor(content: bytes, rng: Random) -> bytes:
    """Safetensors: renamed, swapped, left out, or filled with one extreme number."""
    header, data = _split(content)
    names = [key for key in header if key != "__metadata__"]
    first, second = rng.choice(names), rng.choice(names)
    match rng.randrange(4):
        case 0:
            header[first], header[second] = header[second], header[first]
        case 1:
            header[rng.choice(("a", "", "x" * 300, first + "²"))] = header.pop(first)
        case 2:
            return _without(first, header, data)
        case _:
            start, end = header[first]["data_offsets"]
            layout = "<d" if header[first]["dtype"] in ("F64", "I64") else "<f"
            number = struct.pack(layout, rng.choice((float("nan"), float("inf"), 1e30, -1e30)))
            filled = (number * (end - start))[: end - start]
            data = data[:start] + filled + data[end:]
    return _joined(header, data)


def edit_npy(content: bytes, rng: Random) -> bytes:
    """NumPy: another dtype, shape or order in the header."""
    found = list(_FIELD.finditer(content[:4096]))
    if not found or rng.random() < 0.15:
        return content.replace(b"False", rng.choice((b"True", b"2", b"None", b"[" * 90)), 1)
    match = rng.choice(found)
    new = f"'{rng.choice(DESCRIPTIONS)}'" if match[1] == b"descr" else rng.choice(SHAPES)
    changed = content[: match.start(2)] + new.encode() + content[match.end(2) :]
    grown = len(changed) - len(content)
    length = int.from_bytes(content[8:10], "little") + grown
    return changed[:8] + (length & 0xFFFF).to_bytes(2, "little") + changed[10:]


def edit_member(content: bytes, rng: Random) -> bytes:
    """ZIP: an edit of one member, with checksums that are right."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        infos = archive.infolist()
        members = [(info, archive.read(info)) for info in infos]
    chosen = rng.randrange(len(members))
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for number, (info, inner) in enumerate(members):
            edit = rng.choice(list(edits_of(inner).values()))
            archive.writestr(info, edit(inner, rng) if number == chosen else inner)
    return packed.getvalue()


def edit_chunk(content: bytes, rng: Random) -> bytes:
    """PNG: an edit of one chunk, with a length and a checksum that are right."""
    chunks, place = [], 8
    while place + 12 <= len(content):
        length = int.from_bytes(content[place : place + 4], "big")
        chunks.append((content[place + 4 : place + 8], content[place + 8 : place + 8 + length]))
        place += 12 + length
    number = rng.randrange(len(chunks))
    kind, inner = chunks[number]
    chunks[number] = kind, rng.choice(list(BYTE_EDITS.values()))(inner, rng)
    return content[:8] + b"".join(
        len(inner).to_bytes(4, "big") + kind + inner + zlib.crc32(kind + inner).to_bytes(4, "big")
        for kind, inner in chunks
    )


def edits_of(content: bytes) -> dict[str, BytesEdit]:
    """The edits that fit this content, those of plain bytes among them."""
    found = dict(BYTE_EDITS)
    if is_json(content):
        found |= JSON_EDITS
    if content[8:9] == b"{" and int.from_bytes(content[:8], "little") < len(content):
        found |= _named(edit_dtype, edit_header, edit_metadata, edit_tensor)
    if content.startswith(b"\x93NUMPY"):
        found |= _named(edit_npy)
    if content.startswith(b"PK\3\4"):
        found |= _named(edit_member)
    if content.startswith(b"PK\3\4") and b"data.pkl" in content[:200]:
        found |= _named(odd_tensor)
    if content.startswith(b"\x89PNG"):
        found |= _named(edit_chunk)
    if content.startswith(b"\x1f\x8b"):
        found |= _named(edit_gzip)
    if content.startswith(b"NGSP"):
        found |= _named(edit_zstd_column)
    if content.startswith(b"ply\n") and b"end_header\n" in content:
        found |= _named(edit_ply_row)
    if content.startswith(b"glTF"):
        found |= _named(edit_glb_document)
    return found


def _named(*edits: BytesEdit) -> dict[str, BytesEdit]:
    return {edit.__name__: edit for edit in edits}


def _without(name: str, header: dict, data: bytes) -> bytes:
    """Without a tensor and its bytes: the format allows no holes."""
    start, end = header.pop(name)["data_offsets"]
    for key, entry in header.items():
        if key != "__metadata__" and entry["data_offsets"][0] >= end:
            entry["data_offsets"] = [place - (end - start) for place in entry["data_offsets"]]
    return _joined(header, data[:start] + data[end:])


def _split(content: bytes) -> tuple[dict, bytes]:
    length = int.from_bytes(content[:8], "little")
    return json.loads(content[8 : 8 + length]), content[8 + length :]


def _joined(header: dict, data: bytes) -> bytes:
    text = json.dumps(header).encode()
    return len(text).to_bytes(8, "little") + text + data
