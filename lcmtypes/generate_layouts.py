#!/usr/bin/env python3
"""Writes the wire layout of each LCM type as C++ tables, for the guard that checks a buffer before it is decoded.

usage: generate_layouts.py OUTPUT.h TYPE.lcm...   (a type that another one contains stands anywhere in the list)
"""
import re
import sys

PRIMITIVES = {"int8_t": 1, "byte": 1, "boolean": 1, "int16_t": 2, "int32_t": 4, "float": 4,
              "int64_t": 8, "double": 8, "string": 0}
FIELD = re.compile(r"^\s*(?:(\w+)\.)?(\w+)\s+(\w+)((?:\[\w+\])*)\s*;")


def parse(path):
    """Returns (struct name, [(type, name, dimension or None)])."""
    text = re.sub(r"//[^\n]*|/\*.*?\*/", "", open(path, encoding="utf-8").read(), flags=re.S)
    name = re.search(r"struct\s+(\w+)", text).group(1)
    fields = []
    for line in text.split("{", 1)[1].splitlines():
        match = FIELD.match(line)
        if not match or match.group(2) == "const":
            continue
        dimensions = re.findall(r"\[(\w+)\]", match.group(4))
        if len(dimensions) > 1:
            sys.exit(f"{path}: {match.group(3)}: the guard knows arrays of one dimension only")
        fields.append((match.group(2), match.group(3), dimensions[0] if dimensions else None))
    return name, fields


def row(fields, field, known, path):
    kind, name, dimension = field
    length, fixed = -1, 0
    if dimension is not None:
        if dimension.isdigit():
            fixed = int(dimension)
        else:
            length = [f[1] for f in fields].index(dimension)
            if fields[length][0] != "int32_t":
                sys.exit(f"{path}: {dimension}: the guard knows lengths of type int32_t only")
    if kind in PRIMITIVES:
        nested = "nullptr"
        what = "kString" if kind == "string" else ("kLength" if kind == "int32_t" and dimension is None else "kBytes")
        size = PRIMITIVES[kind]
    elif kind in known:
        nested, what, size = f"&k_{kind}", "kStruct", 0
    else:
        sys.exit(f"{path}: unknown type {kind}")
    array = "true" if dimension is not None else "false"
    return f'    {{"{name}", FieldKind::{what}, {size}, {array}, {length}, {fixed}, {nested}}},'


def main():
    output, paths = sys.argv[1], sys.argv[2:]
    types = {name: (fields, path) for path in paths for name, fields in [parse(path)]}
    lines = ["// Made by lcmtypes/generate_layouts.py from the .lcm files.", "#pragma once", "",
             '#include "common/wire_layout.h"', "", "namespace holdfast::layouts {", ""]
    done = []

    def emit(name):
        if name in done:
            return
        fields, path = types[name]
        for kind, _, _ in fields:
            if kind in types:
                emit(kind)
        done.append(name)
        lines.append(f"inline constexpr FieldLayout k_{name}_fields[] = {{")
        lines.extend(row(fields, f, types, path) for f in fields)
        lines.append("};")
        lines.append(f'inline constexpr TypeLayout k_{name}{{"{name}", k_{name}_fields, '
                     f"{len(fields)}}};\n")

    for name in sorted(types):
        emit(name)
    lines.append("/// Layout of a generated LCM type.\ntemplate <class Message>\ninline constexpr const TypeLayout* of = nullptr;")
    # A flag, since no constant expression may compare the pointer under UndefinedBehaviorSanitizer.
    lines.append("template <class Message>\ninline constexpr bool has = false;")
    for name in sorted(types):
        lines.append(f"template <>\ninline constexpr const TypeLayout* of<{name}> = &k_{name};")
        lines.append(f"template <>\ninline constexpr bool has<{name}> = true;")
    lines += ["", "}  // namespace holdfast::layouts", ""]
    text = "\n".join(lines)
    declarations = "\n".join(f"class {name};" for name in sorted(types))
    text = text.replace("namespace holdfast::layouts {", f"namespace holdfast {{\n{declarations}\n}}\n\nnamespace holdfast::layouts {{", 1)
    with open(output, "w", encoding="utf-8") as stream:
        stream.write(text)


main()
