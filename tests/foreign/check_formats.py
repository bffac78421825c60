"""Checks files of `actcheck report` with external validators.

    check_formats.py junit FILE.xml SCHEMA.xsd
    check_formats.py jsonl FILE.jsonl SCHEMA.json
    check_formats.py earl FILE.ttl VOCABULARY.ttl...    (prints the number of assertions, or the contradictions)

Exit code 1 if a file is not valid.
"""

import json
import sys


def junit(file, schema):
    from lxml import etree

    etree.XMLSchema(etree.parse(schema)).assertValid(etree.parse(file))
    print("valid")


def jsonl(file, schema):
    from jsonschema import Draft202012Validator

    validator = Draft202012Validator(json.load(open(schema)))
    with open(file) as lines:
        observations = [json.loads(line) for line in lines]
    for observation in observations:
        validator.validate(observation)
    print(f"{len(observations)} valid")


def earl(file, *vocabularies):
    from owlrl import DeductiveClosure, OWLRL_Semantics
    from rdflib import Graph, Namespace, RDF

    graph = Graph()
    for each in (file, *vocabularies):
        graph.parse(each, format="turtle")
    terms = Namespace("http://www.w3.org/ns/earl#")
    assertions = len(set(graph.subjects(RDF.type, terms.Assertion)))
    DeductiveClosure(OWLRL_Semantics).expand(graph)
    # owlrl writes contradictions into the graph.
    errors = Namespace("http://www.daml.org/2002/03/agents/agent-ont#")
    contradictions = sorted(str(text) for text in graph.objects(None, errors.error))
    if contradictions:
        sys.exit("\n".join(contradictions))
    print(f"{assertions} assertions, consistent")


if __name__ == "__main__":
    {"junit": junit, "jsonl": jsonl, "earl": earl}[sys.argv[1]](*sys.argv[2:])
