"""Checks logged messages against a JSON Schema: validate.py SCHEMA LOG…

Supports the keywords that the protocol's schema uses, and refuses any other."""

import json
import sys

TYPES = {
    "object": lambda x: isinstance(x, dict),
    "array": lambda x: isinstance(x, list),
    "string": lambda x: isinstance(x, str),
    "boolean": lambda x: isinstance(x, bool),
    "integer": lambda x: isinstance(x, int) and not isinstance(x, bool),
    "number": lambda x: isinstance(x, (int, float)) and not isinstance(x, bool),
    "null": lambda x: x is None,
}
TOLD = {"$schema", "$id", "$defs", "title", "description", "default"}


def faults(value, schema, root, at="$"):
    if schema is True:
        return
    if schema is False:
        yield f"{at}: nothing may be here"
        return
    for key, want in schema.items():
        if key in TOLD:
            continue
        elif key == "$ref":
            yield from faults(value, root["$defs"][want.removeprefix("#/$defs/")], root, at)
        elif key == "type":
            kinds = want if isinstance(want, list) else [want]
            if not any(TYPES[kind](value) for kind in kinds):
                yield f"{at}: {value!r:.60} is no {want}"
        elif key == "const":
            if value != want:
                yield f"{at}: {value!r} is not {want!r}"
        elif key == "enum":
            if value not in want:
                yield f"{at}: {value!r} is none of {want}"
        elif key == "oneOf":
            fitting = [i for i, one in enumerate(want) if not list(faults(value, one, root, at))]
            if len(fitting) != 1:
                yield f"{at}: {json.dumps(value):.300} fits {len(fitting)} of {len(want)}"
        elif key == "required":
            if isinstance(value, dict):
                yield from (f"{at}: `{name}` is missing" for name in want if name not in value)
        elif key == "properties":
            if isinstance(value, dict):
                for name, one in want.items():
                    if name in value:
                        yield from faults(value[name], one, root, f"{at}.{name}")
        elif key == "additionalProperties":
            if isinstance(value, dict):
                for name in value.keys() - schema.get("properties", {}).keys():
                    yield from faults(value[name], want, root, f"{at}.{name}")
        elif key == "items":
            if isinstance(value, list):
                for i, one in enumerate(value):
                    yield from faults(one, want, root, f"{at}[{i}]")
        elif key in ("minItems", "maxItems", "minimum", "maximum", "exclusiveMinimum"):
            size = len(value) if isinstance(value, list) else value
            if TYPES["number"](size):
                fits = {"minItems": size >= want, "minimum": size >= want, "exclusiveMinimum": size > want}
                if not fits.get(key, size <= want):
                    yield f"{at}: {key} {want}, but {size}"
        else:
            sys.exit(f"the keyword {key} is not known here")


def main():
    schema = json.load(open(sys.argv[1]))
    kinds, found = set(), []
    for path in sys.argv[2:]:
        for line in open(path):
            entry = json.loads(line)
            one = {"from": "FromProgram", "to": "ToProgram"}[entry["direction"]]
            kinds.add((entry["direction"], entry["message"]["type"]))
            found += faults(entry["message"], schema["$defs"][one], schema)
            # An invalid message must not pass.
            broken = {**entry["message"], "type": "dance"}
            assert list(faults(broken, schema["$defs"][one], schema)), "anything would pass"
    wanted = {("to", kind) for kind in "hello reset begin observation answer bye".split()}
    wanted |= {("from", kind) for kind in "hello ready command ask end".split()}
    print("\n".join(found[:20]))
    sys.exit(f"never seen: {wanted - kinds}" if wanted - kinds else len(found) > 0)


main()
