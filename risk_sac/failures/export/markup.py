"""XML as all formats write it."""

import xml.etree.ElementTree as ET


def document(root: ET.Element) -> bytes:
    """The whole text, indented; the same element gives the same bytes."""
    ET.indent(root)
    content: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return content + b"\n"
