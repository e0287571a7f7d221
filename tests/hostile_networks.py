"""Uploads that want to do harm, each made when it is asked for; none is kept in the repository."""

import gzip
import io
import re
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
        *_numbers(),
        *_references(),
        *_simulator(),
        *_outputs(),
        *_archives(),
        *_forged_archives(),
        *_requests(),
    ]
    assert len({hostile.name for hostile in found}) == len(found)
    return found


def _documents() -> Iterator[Hostile]:
    """Attacks on the parser."""

    def document(name: str, content: str | bytes | Callable[[], bytes], says: str) -> Hostile:
        make = content if callable(content) else lambda: content.encode() if isinstance(content, str) else content
        return Hostile(name, make, says)

    doctype = "got a DOCTYPE"
    yield document("bare DOCTYPE", f"<!DOCTYPE net>{NET}", doctype)
    yield document(
        "external entity",
        f'<!DOCTYPE net [<!ENTITY e SYSTEM "file:///etc/passwd">]>{NET.replace("1.20", "&e;")}',
        doctype,
    )
    yield document("external DTD", f'<!DOCTYPE net SYSTEM "http://127.0.0.1:9/evil.dtd">{NET}', doctype)
    laughs = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 10))
    yield document(
        "billion laughs", f'<!DOCTYPE net [<!ENTITY l0 "ha">{laughs}]>{NET.replace("1.20", "&l9;")}', doctype
    )
    yield document(
        "quadratic blow-up",
        lambda: f'<!DOCTYPE net [<!ENTITY a "{"a" * 100_000}">]><net version="{"&a;" * 10_000}"/>'.encode(),
        doctype,
    )
    yield document("undefined entity", NET.replace("1.20", "&nbsp;"), "no well-formed XML")
    yield document(
        "XInclude with its namespace",
        f'<net xmlns:xi="http://www.w3.org/2001/XInclude"><xi:include href="/etc/passwd"/>{ROAD}{WEST}{EAST}</net>',
        r"got <.*include> in <net>",
    )
    yield document("bad UTF-8", net("road_0", "r\0ad_0").replace(b"\0", b"\xff\xfe"), "is no UTF-8")
    yield document("UTF-16", NET.encode("utf-16"), "is no xml|is no UTF-8")
    yield document("UTF-7 declared", f'<?xml version="1.0" encoding="UTF-7"?>{NET}', "encoding 'UTF-7'; wanted UTF-8")
    yield document("XML 1.1", f'<?xml version="1.1"?>{NET}', "XML 1.1; wanted 1.0|well-formed")
    yield document("NUL byte", NET.replace("road_0", "ro\0d_0", 1), "is NUL")
    yield document("truncated", NET[: len(NET) // 2], "no well-formed XML")
    yield document("two roots", NET + NET, "no well-formed XML")
    yield document("twice the same attribute", NET.replace("priority=", 'from="east" priority='), "no well-formed XML")
    yield document("text between elements", NET.replace(WEST, "rm -rf /" + WEST), "got the text 'rm -rf /'")
    yield document("another namespace", NET.replace("<net", '<net xmlns="urn:evil"'), "its root is <{urn:evil}net>")
    yield document(
        "depth bomb", lambda: b"<net>" + b'<edge id="e" from="a" to="b">' * 200_000, "got <edge> in <edge>; wanted"
    )
    yield document(
        "100,000 attributes",
        lambda: b"<net " + b" ".join(b'a%d="1"' % i for i in range(100_000)) + b"/>",
        "100000 attributes; wanted at most",
    )
    yield document(
        "attribute of 25 MB", lambda: net("1.20", "x" * 25_000_000), "has 25000000 characters; wanted at most"
    )
    yield document(
        "400,000 elements",
        lambda: b"<net>" + b'<param key="a" value="b"/>' * 400_000 + b"</net>",
        "more than 300000 elements",
    )
    yield document("nothing", b"", "is empty; wanted a network")
    yield document("an executable", b"\x7fELF" + bytes(1000), "is no xml")
    yield document("a page", "<!DOCTYPE html><html><script>alert(1)</script></html>", doctype)
    yield document("only a declaration", '<?xml version="1.0"?>', "no well-formed XML")
    yield document(
        "a simulation's configuration",
        '<configuration><input><net-file value="/etc/passwd"/></input>'
        '<output><tripinfo-output value="/tmp/evil.xml"/></output></configuration>',
        "its root is <configuration>",
    )


def _numbers() -> Iterator[Hostile]:
    """Numbers that are none, or that no road has."""
    shape, wanted = "0.00,-1.60 100.00,-1.60", "shape of <lane> is .*; wanted points"
    for name, value in {
        "NaN": "NaN,NaN 100,0",
        "infinite": "0,0 inf,0",
        "half": "0,0 100",
        "empty": "",
        "wordy": "here there",
    }.items():
        yield Hostile(f"{name} shape", lambda value=value: net(shape, value), wanted)
    yield Hostile("shape of one point", lambda: net(shape, "0,0"), "a shape of 1 points; wanted two at least")
    yield Hostile("shape of 10^6 points", lambda: net(shape, "1,1 " * 1_000_000), "characters; wanted at most")
    for attribute, good in {"length": "100.00", "speed": "13.89"}.items():
        for value in ("NaN", "inf", "-1", "1e999", "0x10", "", "${HOME}"):
            yield Hostile(
                f"{attribute} {value!r}",
                lambda attribute=attribute, good=good, value=value: net(
                    f'{attribute}="{good}"', f'{attribute}="{value}"'
                ),
                f"{attribute} of <lane> is {re.escape(repr(value))}; wanted a number from 0",
            )
    yield Hostile("junction at NaN", lambda: net('x="100.00"', 'x="nan"'), "x of <junction> is 'nan'; wanted a number")
    yield Hostile("lane index 10^9", lambda: net('index="0"', 'index="1000000000"'), "index of <lane>")
    yield Hostile("priority of a million digits", lambda: net('"1"', f'"{"9" * 90_000}"'), "priority of <edge>")


def _references() -> Iterator[Hostile]:
    """Parts that speak of what is not there, or that are too many."""
    connection = '<connection from="road" to="road" fromLane="0" toLane="0" dir="s" state="M"/>'

    def changed(name: str, old: str, new: str, says: str) -> Hostile:
        return Hostile(name, lambda: net(old, new), says)

    yield changed("unknown junction", 'to="east"', 'to="nowhere"', "names the junction 'nowhere'")
    yield changed("no junction", 'from="west" ', "", r"edge 'road' goes from and to \('east',\)")
    yield changed("the same edge twice", ROAD, ROAD + ROAD, "edge 'road' is there twice")
    yield changed("a lane out of turn", 'index="0"', 'index="5"', "has the index 5; wanted 0")
    yield changed("an edge without lanes", EAST, EAST + '<edge id="bare" from="east" to="west"/>', "'bare' has no lane")
    yield changed("no roads", ROAD, "", "names the lane 'road_0'")
    yield Hostile("nothing at all", lambda: b"<net/>", "no edge outside junctions")
    yield changed("unknown lane", 'incLanes="road_0"', 'incLanes="road_7"', "names the lane 'road_7'")
    yield changed("connection from nowhere", EAST, EAST + connection.replace("road", "x", 1), "names an edge that")
    yield changed(
        "connection to a lane too many",
        EAST,
        EAST + connection.replace('toLane="0"', 'toLane="9"'),
        "has toLane 9; wanted less than 1",
    )
    yield changed(
        "connection via nothing",
        EAST,
        EAST + connection.replace("dir=", 'via=":x_0_0" dir='),
        "goes via the lane ':x_0_0'",
    )
    yield changed("crossing of nothing", ">" + LANE, ' crossingEdges="x y">' + LANE, "names the edge 'x'")
    for name, value in {
        "empty id": "",
        "id of 5,000 characters": "x" * 5000,
        "id with a control character": "a\x7fb",
        "id with a tag": "a&lt;b",
        "id from the environment": "${HOME}",
        "id that turns the text": "a\u202eb",
    }.items():
        yield changed(name, 'id="road"', f'id="{value}"', "id of <edge> is .*; wanted an id")
    yield changed("name from the environment", "priority=", 'name="${PATH}" priority=', "name of <edge>")
    yield Hostile(
        "10^6 edges",
        lambda: gzip.compress(_many(1_000_000)),
        "more than 50000 edges",
        GZIP,
    )
    lanes = "".join(f'<lane id="l{i}" index="{i}" speed="1" length="1" shape="0,0 1,1"/>' for i in range(1000))
    yield changed("1,000 lanes", LANE, lanes, "index of <lane> is '64'")


def _many(count: int) -> bytes:
    return b"<net>" + b"".join(b'<edge id="e%x" from="a" to="b"/>' % i for i in range(count)) + b"</net>"


def _simulator() -> Iterator[Hostile]:
    """What only the simulator notices, or what would make it read a file."""
    light = (
        '<tlLogic id="east" type="{type}" programID="0" offset="0">'
        '<phase duration="{duration}" state="{state}"/></tlLogic>'
    )

    def lights(type: str = "static", duration: str = "10", state: str = "r", says: str = "") -> Hostile:
        program = light.format(type=type, duration=duration, state=state)
        return Hostile(f"signal {type} {duration} {state[:5]}", lambda: net(EAST, program + EAST), says)

    cannot = "the simulator cannot load it: "
    yield Hostile("junction without a way out, at which SUMO 1.28 crashes", _dead_end, cannot)
    yield lights(type="from_file", says="type of <tlLogic>")
    yield lights(duration="NaN", says="duration of <phase>")
    yield lights(duration="-5", says="duration of <phase>")
    yield lights(state="../../etc", says="state of <phase>")
    yield lights(state="G" * 50_000, says="state of <phase>")
    yield Hostile(
        "unknown function", lambda: net("priority=", 'function="evil" priority='), "no edge outside|cannot load"
    )
    yield Hostile("unknown junction type", lambda: net('type="dead_end"', 'type="evil"'), cannot)
    request = '<request index="0" response="1111" foes="01"/></junction>'
    yield Hostile(
        "right of way for nobody",
        lambda: net(EAST, EAST.replace("dead_end", "priority").replace("/>", f">{request}")),
        cannot,
    )
    for name, projection in {
        "PROJ with a grid": "+proj=utm +zone=32 +nadgrids=/etc/passwd",
        "PROJ with a file": "+init=/etc/passwd:1",
        "PROJ pipeline": "+proj=pipeline +step +proj=hgridshift +grids=http://127.0.0.1:9/x",
        "PROJ from the environment": "+proj=${HOME}",
    }.items():
        location = (
            f'<location netOffset="0,0" convBoundary="0,0,1,1" origBoundary="0,0,1,1" projParameter="{projection}"/>'
        )
        yield Hostile(name, lambda location=location: net(ROAD, location + ROAD), "projParameter of <location>")


def _dead_end() -> bytes:
    """A net of ours in which a lane inside a junction leads nowhere."""
    lines = DENSE.read_bytes().splitlines(keepends=True)
    left = [line for line in lines if b'from=":centre_13" to="to_east"' not in line]
    assert len(left) < len(lines)
    return b"".join(left)


def _outputs() -> Iterator[Hostile]:
    """Files beside the net that want to write, to include or to reach into the environment."""

    def beside(name: str, content: str, says: str) -> Hostile:
        root = "routes" if content.startswith(("<vehicle ", "<flow ", "<route ", "<trip ", "<vType ")) else "additional"
        return Hostile(name, lambda: zipped(NET, f"<{root}>{content}</{root}>"), says, ZIP)

    target = 'file="/tmp/evil.xml"'
    for element, rest in {
        "e1Detector": f'id="d" lane="road_0" pos="1" freq="1" {target}',
        "edgeData": f'id="d" {target}',
        "routeProbe": f'id="d" edge="road" freq="1" {target}',
        "calibrator": 'id="d" edge="road" pos="0" output="/tmp/evil.xml"',
        "variableSpeedSign": 'id="d" lanes="road_0" file="/etc/passwd"',
        "timedEvent": 'type="SaveTLSStates" source="east" dest="/tmp/evil.xml"',
        "include": 'href="/etc/passwd"',
        "configuration": "",
    }.items():
        yield beside(element, f"<{element} {rest}/>", rf"got <{element}> in <additional>.*[Nn]othing that names a file")
    refused = "has the attribute .*Nothing that names a file"
    yield beside("picture on the map", '<poly id="p" shape="0,0 1,1 1,0" imgFile="/etc/passwd"/>', refused)
    yield beside("output of a bus stop", '<busStop id="b" lane="road_0" output="/tmp/evil.xml"/>', refused)
    yield beside(
        "emissions from a file", '<vType id="t" emissionClass="PHEMlight/../../etc/passwd"/>', "emissionClass of"
    )
    ssm = '<param key="has.ssm.device" value="true"/><param key="device.ssm.file" value="/tmp/evil.xml"/>'
    yield beside("device that writes, of a type", f'<vType id="t">{ssm}</vType>', "got <param> in <vType>")
    yield beside(
        "signal that writes",
        '<tlLogic id="x" type="actuated" programID="1"><param key="file" value="/tmp/evil.xml"/></tlLogic>',
        "got <param> in <tlLogic>",
    )
    yield beside(
        "signal with code",
        '<tlLogic id="x" type="actuated" programID="1"><condition id="c" value="1"/></tlLogic>',
        "got <condition> in <tlLogic>",
    )
    yield beside(
        "parameter of a place that names a file",
        '<poi id="p" x="0" y="0"><param key="output.File" value="/tmp/evil"/></poi>',
        "key of <param>",
    )
    yield beside("line from the environment", '<vehicle id="v" depart="0" line="${HOME}"/>', "line of <vehicle>")
    yield beside("route to nowhere", '<route id="r" edges="road nowhere"/>', "names the edge 'nowhere'")
    yield beside("departure at NaN", '<vehicle id="v" depart="NaN"/>', "depart of <vehicle>")
    yield beside(
        "flow of 10^9", '<flow id="f" from="road" to="road" begin="0" end="9" number="1000000000"/>', "number of"
    )
    yield beside("flow with code", '<flow id="f" from="road" to="road" period="exp(__import__)"/>', "period of <flow>")
    yield beside(
        "car park for 2^31", '<parkingArea id="p" lane="road_0" roadsideCapacity="2147483647"/>', "roadsideCapacity"
    )
    yield beside("endless route", '<route id="r" edges="road" repeat="2000000000"/>', "repeat of <route>")
    yield beside("unknown attribute", '<vehicle id="v" depart="0" onload="x"/>', refused)
    yield beside(
        "unknown type", '<vehicle id="v" depart="0" type="ghost"><route edges="road"/></vehicle>', "cannot load it"
    )
    yield Hostile("two nets", lambda: zipped(NET, NET), "there are 2 nets", ZIP)
    yield Hostile("a configuration beside", lambda: zipped(NET, "<configuration/>"), "its root is <configuration>", ZIP)


def _archives() -> Iterator[Hostile]:
    """Archives that unpack to too much, or to elsewhere."""

    def named(name: str, path: str, says: str = "wanted a name that stays inside") -> Hostile:
        return Hostile(f"entry {name}", lambda: zipped(NET, names=(path,)), says, ZIP)

    def entry(name: str, says: str, *, mode: int = 0, method: int = zipfile.ZIP_DEFLATED) -> Hostile:
        def make() -> bytes:
            buffer = io.BytesIO()
            with zipfile.ZipFile(buffer, "w", method) as archive:
                info = zipfile.ZipInfo("net.xml")
                info.external_attr, info.compress_type = mode << 16, method
                archive.writestr(info, "/etc/passwd" if mode else NET)
            return buffer.getvalue()

        return Hostile(name, make, says, ZIP)

    yield named("up the tree", "../../../etc/cron.d/evil")
    yield named("at the root", "/etc/cron.d/evil")
    yield named("with backslashes", "..\\..\\evil.xml")
    yield named("with an escape sequence", "net\x1b[2J.xml", "wanted at most 200 printable characters")
    yield entry("symbolic link", "is a symbolic link", mode=stat.S_IFLNK | 0o777)
    yield entry("named pipe", "is a special file", mode=stat.S_IFIFO | 0o666)
    yield entry("bzip2", "is packed by method 12", method=zipfile.ZIP_BZIP2)
    yield Hostile("archive in an archive", lambda: zipped(zipped(NET)), "no well-formed XML|is no UTF-8", ZIP)
    yield Hostile("gzip in gzip", lambda: gzip.compress(gzip.compress(NET.encode())), "is no UTF-8", GZIP)
    yield Hostile("tar in gzip", _tar, "is NUL", GZIP)
    yield Hostile("10,000 entries", lambda: zipped(*["<x/>"] * 10_000), "has 10000 entries; wanted at most", ZIP)
    yield Hostile("no entries", lambda: zipped(), "is no zip", ZIP)
    yield Hostile("gzip bomb of 1 GiB", lambda: _bomb(1 << 30), "times their size|more than 64 MiB", GZIP)
    yield Hostile("gzip bomb that looks like XML", lambda: _bomb(1 << 28, b"<net>", b" "), "times their size", GZIP)
    yield Hostile("zip bomb", lambda: zipped(bytes(1 << 28)), "times their size|more than 64 MiB", ZIP)
    yield Hostile("half of a gzip file", lambda: gzip.compress(NET.encode())[:-30], "gzip file is damaged", GZIP)
    yield Hostile("gzip with a wrong checksum", lambda: _flipped(gzip.compress(NET.encode()), -6), "is damaged", GZIP)
    yield Hostile("half of an archive", lambda: zipped(NET)[:-30], "zip file is damaged", ZIP)
    yield Hostile("XML called gzip", lambda: NET.encode(), "is no gzip", GZIP)


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

    def zip64(content: bytearray) -> None:
        struct.pack_into("<I", content, central(content) + 24, 0xFFFFFFFF)

    def same_name(content: bytearray) -> None:
        content[:] = content.replace(b"1.xml", b"0.xml")

    def other_name(content: bytearray) -> None:
        content[content.index(b"0.xml")] = ord("9")

    def with_nul(content: bytearray) -> None:
        at = content.index(b"0.xml", central(content))
        content[at + 1] = 0

    def offset_of_directory(content: bytearray) -> None:
        struct.pack_into("<I", content, content.index(b"PK\x05\x06") + 16, 0xFFFFFF)

    yield forged("encrypted entry", encrypt, "is encrypted")
    yield forged("size understated", understate, "is damaged: Bad CRC")
    yield forged("two entries in one place", overlap, "overlap")
    yield forged("64-bit size that is missing", zip64, "which it says it has")
    yield forged("the same name twice", same_name, "wanted each name once")
    yield forged("names that differ", other_name, "is damaged")
    yield forged("name with NUL", with_nul, "printable characters")
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
