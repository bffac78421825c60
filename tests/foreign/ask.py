"""Queries an endpoint with SPARQLWrapper, by GET and by POST, and for a graph: ask.py ENDPOINT QUERY. Prints the row counts."""

import json
import sys

from SPARQLWrapper import GET, JSON, POST, TURTLE, SPARQLWrapper

endpoint, query = sys.argv[1:]
counts = {}
for method in (GET, POST):
    client = SPARQLWrapper(endpoint)
    client.setQuery(query)
    client.setReturnFormat(JSON)
    client.setMethod(method)
    counts[method] = len(client.query().convert()["results"]["bindings"])

from rdflib import Graph

client = SPARQLWrapper(endpoint)
client.setQuery("CONSTRUCT { ?run a <http://actions#Run> } WHERE { ?run a <http://actions#Run> }")
client.setReturnFormat(TURTLE)
counts["triples"] = len(Graph().parse(data=client.query().convert(), format="turtle"))
print(json.dumps(counts))
