"""Harmful uploads, each made on demand; none is kept in the repository."""

import gzip
import io
import stat
import struct
import tarfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

LANE = '<lane id="road_0" index="0" speed="13.89" length="100.00" shape="0.00,-1.60 100.00,-1.60"/>'
ROAD = f'<edge id="road" from="west" to="east" priority="1">{LANE}</edge>'
WEST = '<junction id="west" type="dead_end" x="0.00" y="0.00" incLanes="" intLanes="" shape="0.00,0.00 0.00,-3.20"/>'
EAST = '<junction id="east" type="dead_end" x="100.00" y="0.00" incLanes="road_0" intLanes="" shape="100,-3.2 100,0"/>'
NET = f'<net version="1.20">{ROAD}{WEST}{EAST}</net>'
ROUTES = '<routes><vehicle id="car" depart="0"><route edges="road"/></vehicle></routes>'
ADDITIONAL = '<additional><vType id="lorry" vClass="truck"/></additional>'

DENSE = Path(__file__).parents[1] / "sumo_nets" / "dense" / "dense.net.xml"
XML, GZIP, ZIP = "application/xml", "application/gzip", "application/zip"


@dataclass(frozen=True)
class Hostile:
    """One upload and what its refusal must say."""

    name: str
    make: Callable[[], bytes]
    says: str  # regular expression
    content_type: str = XML
    status: int = 422


def zipped(*files: str | bytes, names: tuple[str, ...] = ()) -> bytes:
    """An archive; files without a name of their own are numbered."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for number, content in enumerate(files):
            archive.writestr(names[number] if names else f"{number}.xml", content)
    return buffer.getvalue()


def net(old: str = "", new: str = "") -> bytes:
    """The good net with one change."""
    assert old in NET
    return NET.replace(old, new, 1).encode()


def uploads() -> list[Hostile]:
    """All of them; names are unique."""
    found = [
        *_documents(),
        *_nets(),
        *_outputs(),
        *_archives(),
        *_forged_archives(),
        *_requests(),
    ]
    assert len({hostile.name for hostile in found}) == len(found)
    return found


def _documents() -> Iterator[Hostile]:
    """Attacks on the parser, and documents that are no map."""
    doctype, broken = "got a DOCTYPE", "no well-formed XML"
    external = f'<!DOCTYPE net [<!ENTITY e SYSTEM "file:///etc/passwd">]>{NET.replace("1.20", "&e;")}'
    laughs = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 10))
    for name, content, says in [
        ("external entity", external, doctype),
        ("external DTD", f'<!DOCTYPE net SYSTEM "http://127.0.0.1:9/evil.dtd">{NET}', doctype),
        ("billion laughs", f'<!DOCTYPE net [<!ENTITY l0 "ha">{laughs}]>{NET.replace("1.20", "&l9;")}', doctype),
        ("undefined entity", NET.replace("1.20", "&nbsp;"), broken),
        ("XInclude", NET.replace(ROAD, f'<xi:include href="/etc/passwd"/>{ROAD}'), "got <xi:include> with 'href'"),
        ("UTF-7 declared", f'<?xml version="1.0" encoding="UTF-7"?>{NET}', broken),
        ("NUL byte", NET.replace("road_0", "ro\0d_0", 1), broken),
        ("truncated", NET[: len(NET) // 2], broken),
        ("two roots", NET + NET, broken),
        ("nothing", "", "an empty file"),
        ("a page", "<!DOCTYPE html><html><script>alert(1)</script></html>", doctype),
        ("a simulation's configuration", "<configuration/>", "whose root is <configuration>"),
        ("no roads", "<net/>", "without roads"),
    ]:
        yield Hostile(name, lambda content=content: content.encode(), says)
    entity = b'<!DOCTYPE net [<!ENTITY a "' + b"a" * 100_000 + b'">]><net version="'
    yield Hostile("quadratic blow-up", lambda: entity + b"&a;" * 10_000 + b'"/>', doctype)
    yield Hostile("depth bomb", lambda: b"<net>" + b'<edge id="e" from="a" to="b">' * 200_000, "nested more than 20")
    attributes = b" ".join(b'a%d="1"' % i for i in range(100_000))
    yield Hostile("100,000 attributes", lambda: b"<net " + attributes + b"/>", "with 100000 attributes")
    yield Hostile("attribute of 25 MB", lambda: net("1.20", "x" * 25_000_000), "25000000 characters in 'version'")
    yield Hostile("an executable", lambda: b"\x7fELF" + bytes(1000), broken)
    edges = b"".join(b'<edge id="e%x" from="a" to="b"/>' % i for i in range(1_000_000))
    yield Hostile("10^6 edges", lambda: gzip.compress(b"<net>" + edges + b"</net>"), "more than 50000 roads", GZIP)
    ways = b'<way id="1"><nd ref="1"/><nd ref="2"/><tag k="highway" v="primary"/></way>' * 199_999
    yield Hostile("199,999 ways", lambda: b"<osm>" + ways + b"</osm>", "more than 50000 roads")


def _nets() -> Iterator[Hostile]:
    """Nets with invalid numbers, missing parts, or at which SUMO crashes."""
    shape, cannot = "0.00,-1.60 100.00,-1.60", "the simulator cannot load it: "
    light = '<tlLogic id="east" type="static" programID="0" offset="0"><phase duration="-5" state="r"/></tlLogic>'
    via = '<connection from="road" to="road" fromLane="0" toLane="0" via=":x_0_0" dir="s" state="M"/>'
    for name, old, new, says in [
        ("shape at NaN", shape, "NaN,NaN 100,0", "'NaN' is no number"),
        ("shape at infinity", shape, "0,0 inf,0", "'inf' is no number"),
        ("half a shape", shape, "0,0 100", "is no shape"),
        ("no shape", shape, "", "has no shape"),
        ("shape of 10^6 points", shape, "1,1 " * 1_000_000, "4000000 characters in 'shape'"),
        ("length of 1e999", "100.00", "1e999", "'1e999' is no number"),
        ("length from the environment", "100.00", "${HOME}", "could not convert string to float: '_{HOME}'"),
        ("junction at NaN", 'x="100.00"', 'x="nan"', "'nan' is no number"),
        ("priority of a million digits", '"1"', f'"{"9" * 90_000}"', cannot),
        ("id of 5,000 characters", 'id="road"', f'id="{"x" * 5000}"', "an id of 5000 characters"),
        ("unknown junction", 'to="east"', 'to="nowhere"', cannot),
        ("no junction", 'from="west" ', "", "the net lacks 'from'"),
        ("the same edge twice", ROAD, ROAD + ROAD, cannot),
        ("an edge without lanes", EAST, EAST + '<edge id="bare" from="east" to="west"/>', "'bare' has 0 lanes"),
        ("a connection to a lane too many", EAST, EAST + via.replace('toLane="0"', 'toLane="9"'), "names lane 9"),
        ("a connection via nothing", EAST, EAST + via, cannot),
        ("unknown junction type", 'type="dead_end"', 'type="evil"', cannot),
        ("negative phase, at which SUMO 1.28 crashes", EAST, light + EAST, cannot),
        ("PROJ with a grid", ROAD, _located("+proj=utm +nadgrids=/etc/passwd"), "projParameter with '/'"),
        ("PROJ pipeline", ROAD, _located("+proj=pipeline +grids=http://127.0.0.1:9/x"), "projParameter with '/'"),
    ]:
        yield Hostile(name, lambda old=old, new=new: net(old, new), says)
    yield Hostile("junction without a way out, at which SUMO 1.28 crashes", _dead_end, cannot)


def _located(projection: str) -> str:
    boundary = 'netOffset="0,0" convBoundary="0,0,1,1" origBoundary="0,0,1,1"'
    return f'<location {boundary} projParameter="{projection}"/>{ROAD}'


def _dead_end() -> bytes:
    """Our net with a lane inside a junction that leads nowhere."""
    lines = DENSE.read_bytes().splitlines(keepends=True)
    left = [line for line in lines if b'from=":centre_13" to="to_east"' not in line]
    assert len(left) < len(lines)
    return b"".join(left)


def _outputs() -> Iterator[Hostile]:
    """Files beside the net that want to write, or to include."""
    target = 'file="/tmp/evil.xml"'
    for content, says in [
        (f'<e1Detector id="d" lane="road_0" pos="1" freq="1" {target}/>', "<e1Detector> with 'file'"),
        (f'<edgeData id="d" {target}/>', "<edgeData> with 'file'"),
        ('<calibrator id="d" edge="road" pos="0" output="/tmp/evil.xml"/>', "<calibrator> with 'output'"),
        ('<timedEvent type="SaveTLSStates" source="east" dest="/tmp/evil.xml"/>', "<timedEvent> with 'dest'"),
        ('<include href="/etc/passwd"/>', "<include> with 'href'"),
        ('<poly id="p" shape="0,0 1,1 1,0" imgFile="/etc/passwd"/>', "<poly> with 'imgFile'"),
        ('<vType id="t"><param key="has.ssm.device" value="true"/></vType>', "<param> with 'has.ssm.device'"),
        ('<vType id="t"><param key="device.ssm.file" value="/tmp/evil.xml"/></vType>', "with 'device.ssm.file'"),
        ('<tlLogic id="x" type="actuated"><param key="file" value="/tmp/evil"/></tlLogic>', "<param> with 'file'"),
        ('<vType id="t" emissionClass="PHEMlight/../../etc/passwd"/>', "the simulator cannot load it"),
        ('<parkingArea id="p" lane="road_0" roadsideCapacity="2147483647"/>', "the simulator cannot load it"),
        ('<vehicle id="v" depart="0" type="ghost"><route edges="road"/></vehicle>', "the simulator cannot load it"),
    ]:
        document = f"<additional>{content}</additional>"
        yield Hostile(content[:40], lambda document=document: zipped(NET, document), says, ZIP)
    yield Hostile("two nets", lambda: zipped(NET, NET), "with 2 maps", ZIP)


def _archives() -> Iterator[Hostile]:
    """Archives that unpack to too much, or to elsewhere."""

    def named(name: str, path: str) -> Hostile:
        return Hostile(f"entry {name}", lambda: zipped(NET, names=(path,)), "wanted a printable name", ZIP)

    def entry(name: str, says: str, *, mode: int) -> Hostile:
        def make() -> bytes:
            buffer = io.BytesIO()
            with zipfile.ZipFile(buffer, "w") as archive:
                info = zipfile.ZipInfo("net.xml")
                info.external_attr = mode << 16
                archive.writestr(info, "/etc/passwd")
            return buffer.getvalue()

        return Hostile(name, make, says, ZIP)

    yield named("up the tree", "../../../etc/cron.d/evil")
    yield named("at the root", "/etc/cron.d/evil")
    yield named("with backslashes", "..\\..\\evil.xml")
    yield named("with an escape sequence", "net\x1b[2J.xml")
    yield entry("symbolic link", "is a link", mode=stat.S_IFLNK | 0o777)
    yield entry("named pipe", "is a link", mode=stat.S_IFIFO | 0o666)
    yield Hostile("archive in an archive", lambda: zipped(zipped(NET)), "no well-formed XML", ZIP)
    yield Hostile("gzip in gzip", lambda: gzip.compress(gzip.compress(NET.encode())), "no well-formed XML", GZIP)
    yield Hostile("tar in gzip", _tar, "no well-formed XML", GZIP)
    yield Hostile("10,000 entries", lambda: zipped(*["<x/>"] * 10_000), "with 10000 entries", ZIP)
    yield Hostile("no entries", lambda: zipped(), "with 0 maps", ZIP)
    yield Hostile("gzip bomb of 1 GiB", lambda: _bomb(1 << 30), "times its size", GZIP)
    yield Hostile("gzip bomb that looks like XML", lambda: _bomb(1 << 28, b"<net>", b" "), "times its size", GZIP)
    yield Hostile("zip bomb", lambda: zipped(bytes(1 << 28)), "times its size", ZIP)
    yield Hostile("half of a gzip file", lambda: gzip.compress(NET.encode())[:-30], "is damaged", GZIP)
    yield Hostile("gzip with a wrong checksum", lambda: _flipped(gzip.compress(NET.encode()), -6), "is damaged", GZIP)
    yield Hostile("half of an archive", lambda: zipped(NET)[:-30], "is damaged", ZIP)


def _forged_archives() -> Iterator[Hostile]:
    """Archives whose headers lie."""

    def forged(name: str, forge: Callable[[bytearray], None], says: str) -> Hostile:
        def make() -> bytes:
            content = bytearray(zipped(NET, ROUTES))
            forge(content)
            return bytes(content)

        return Hostile(name, make, says, ZIP)

    def central(content: bytearray) -> int:
        return content.index(b"PK\x01\x02")

    def encrypt(content: bytearray) -> None:
        content[central(content) + 8] |= 1

    def understate(content: bytearray) -> None:
        struct.pack_into("<I", content, central(content) + 24, 10)

    def overlap(content: bytearray) -> None:
        second = content.index(b"PK\x01\x02", central(content) + 1)
        struct.pack_into("<I", content, second + 42, 0)

    def other_name(content: bytearray) -> None:
        content[content.index(b"0.xml")] = ord("9")

    def with_nul(content: bytearray) -> None:
        at = content.index(b"0.xml", central(content))
        content[at + 1] = 0

    def offset_of_directory(content: bytearray) -> None:
        struct.pack_into("<I", content, content.index(b"PK\x05\x06") + 16, 0xFFFFFF)

    yield forged("encrypted entry", encrypt, "or encrypted")
    yield forged("size understated", understate, "is damaged: Bad CRC")
    yield forged("two entries in one place", overlap, "overlap")
    yield forged("names that differ", other_name, "is damaged")
    yield forged("name with NUL", with_nul, "printable name")
    yield forged("directory outside the file", offset_of_directory, "is damaged")


def _requests() -> Iterator[Hostile]:
    """What is wrong before anyone looks inside."""
    for declared in ("", "text/plain", "application/json", "multipart/form-data", "application/x-tar", "image/svg+xml"):
        yield Hostile(f"declared as {declared!r}", lambda: NET.encode(), "wanted application/xml", declared, 415)
    yield Hostile("33 MiB", lambda: NET.encode() + b" " * (33 << 20), "larger than 33554432 bytes", XML, 413)


def _tar() -> bytes:
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w:gz") as archive:
        info = tarfile.TarInfo("../../evil.net.xml")
        info.size = len(NET)
        archive.addfile(info, io.BytesIO(NET.encode()))
    return buffer.getvalue()


def _bomb(size: int, start: bytes = b"", filler: bytes = b"\0") -> bytes:
    """A gzip file that unpacks to so many bytes, made in pieces."""
    packer = zlib.compressobj(9, wbits=31)
    piece = filler * (1 << 20)
    return packer.compress(start) + b"".join(packer.compress(piece) for _ in range(size >> 20)) + packer.flush()


def _flipped(content: bytes, at: int) -> bytes:
    changed = bytearray(content)
    changed[at] ^= 1
    return bytes(changed)
