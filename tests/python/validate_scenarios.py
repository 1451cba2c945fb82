"""Validates scenario files with the schema that `formation schema` prints, as editors do.

Usage:
    validate_scenarios.py FILE...      with the schema on its input; prints {"FILE": ["PLACE: what is wrong", ...], ...}
"""

import json
import sys

import yaml
from jsonschema import Draft202012Validator
from jsonschema.validators import validator_for


def main():
    schema = json.load(sys.stdin)
    kind = validator_for(schema, default=Draft202012Validator)
    kind.check_schema(schema)
    validator = kind(schema)
    result = {}
    for path in sys.argv[1:]:
        with open(path, encoding="utf-8") as file:
            scenario = yaml.safe_load(file)
        result[path] = [f"{error.json_path}: {error.message}" for error in validator.iter_errors(scenario)]
    print(json.dumps(result))


if __name__ == "__main__":
    main()
