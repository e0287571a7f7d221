"""Lists the elements of a scenario that were not read, by line, with the effect."""

from collections import defaultdict
from collections.abc import Iterator

from risk_sac.openscenario.elements import XmlElement

_SILENT = frozenset({"FileHeader", "License", "Properties", "Property", "CatalogLocations", "ParameterDeclarations"})
_EFFECTS = {
    "Performance": "limits are those of the body",
    "Axles": "turning follows the road",
    "TrafficSignals": "signals keep the program of the road",
    "MonitorDeclarations": "nothing is monitored",
    "Trailer": "there is no trailer",
}
_UNKNOWN = "it has no effect"
_MOST_LINES = 10


def unread(root: XmlElement) -> list[str]:
    """Returns a line for each kind of element of a file that nothing read."""
    lines = defaultdict[str, list[int]](list)
    for element in _unused(root):
        lines[element.tag].append(element.line)
    return [
        f"{root.file}, line{'s' if len(at) > 1 else ''} {', '.join(map(str, at[:_MOST_LINES]))}"
        f"{', …' if len(at) > _MOST_LINES else ''}, <{tag[:80]}>: not read; {_EFFECTS.get(tag, _UNKNOWN)}"
        for tag, at in lines.items()
    ]


def _unused(element: XmlElement) -> Iterator[XmlElement]:
    """Yields elements that nothing read, within elements that were; other entries of a catalog do not count."""
    for child in element.children:
        if child.used:
            yield from _unused(child)
        elif child.tag not in _SILENT and "Catalog" not in (child.tag, element.tag):
            yield child
