"""Validates configurations with a JSON Schema: prints the refused ones, one per line, with the reason.

check_campaigns.py SCHEMA FOLDER"""

import json
import pathlib
import sys
import tomllib

from jsonschema import Draft202012Validator
from jsonschema.exceptions import best_match

schema = json.loads(pathlib.Path(sys.argv[1]).read_text())
Draft202012Validator.check_schema(schema)
validator = Draft202012Validator(schema)
for path in sorted(pathlib.Path(sys.argv[2]).glob("*.toml")):
    fault = best_match(validator.iter_errors(tomllib.loads(path.read_text())))
    if fault is not None:
        reason = f"{fault.json_path}: {fault.message}".replace("\n", " ")
        print(f"{path.name}\t{reason:.200}")
