#!/usr/bin/env python3
"""Checks X3D files in XML against the standard's own model, as the package x3d holds it:
names of nodes and fields, types and ranges of values, and which node may stand in which field.

    pip install --target target/x3d x3d && PYTHONPATH=target/x3d tools/x3d_check.py FILE...
"""
import sys
import xml.etree.ElementTree as tree

from x3d import x3d


def value(text, kind):
    """The value of an attribute of this type, as the package wants it."""
    name = kind.__name__
    words = text.replace(",", " ").split()
    if name == "SFBool":
        return {"true": True, "false": False}[text]
    if name == "SFString":
        return text
    if name == "MFString":
        return [part for part in text.split('"') if part.strip()] if '"' in text else [text]
    read = int if "Int32" in name else float
    numbers = [read(word) for word in words]
    if name in ("SFInt32", "SFFloat", "SFDouble", "SFTime"):
        (number,) = numbers
        return number
    width = {"Vec2": 2, "Vec3": 3, "Color": 3, "Rotat": 4, "Vec4": 4}.get(name[2:7].rstrip("fd"), 1)
    width = 4 if name.endswith("ColorRGBA") else width
    groups = [tuple(numbers[i : i + width]) for i in range(0, len(numbers), width)]
    if any(len(group) != width for group in groups):
        raise ValueError(f"{len(numbers)} numbers in groups of {width}")
    if name.startswith("SF"):
        (group,) = groups
        return group
    return numbers if width == 1 else groups


def node(element, path):
    """The node of an element with all inside of it; the package raises what is wrong."""
    path = f"{path}/{element.tag}"
    kind = getattr(x3d, element.tag, None)
    if kind is None:
        raise ValueError(f"{path}: there is no such node")
    fields = {name: kind_ for name, _, kind_, _, _ in kind.FIELD_DECLARATIONS()}
    given = {}
    for name, text in element.attrib.items():
        if name == "containerField" or name.startswith("{"):
            continue
        if f"{name}_" in fields:
            name = f"{name}_"  # a word of Python's own
        if name not in fields:
            raise ValueError(f"{path}: there is no field {name}")
        try:
            given[name] = value(text, fields[name])
        except (ValueError, KeyError) as problem:
            raise ValueError(f"{path}, {name}: {problem}") from problem
    for child in element:
        made = node(child, path)
        default = getattr(made, "CONTAINERFIELD_DEFAULT", lambda: "children")()
        slot = child.get("containerField", default)
        if element.tag == "X3D":
            slot = child.tag
        elif element.tag in ("Scene", "head"):
            slot = "children"
        elif slot not in fields:
            slot = "children" if "children" in fields else slot
        if slot not in fields:
            raise ValueError(f"{path}: {child.tag} does not belong into {slot}")
        if fields[slot].__name__ == "MFNode" or slot == "children":
            given.setdefault(slot, []).append(made)
        elif slot in given:
            raise ValueError(f"{path}: two nodes in {slot}")
        else:
            given[slot] = made
    try:
        return kind(**given)
    except Exception as problem:
        raise ValueError(f"{path}: {problem}") from problem


def main():
    failed = False
    for file in sys.argv[1:]:
        try:
            node(tree.parse(file).getroot(), "")
            print(f"{file}: valid")
        except (ValueError, tree.ParseError) as problem:
            print(f"{file}: {problem}")
            failed = True
    sys.exit(failed)


main()
