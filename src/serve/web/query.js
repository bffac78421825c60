"use strict";

const form = document.getElementById("form");
const text = document.getElementById("query");
const example = document.getElementById("example");
const about = document.getElementById("about");
const said = document.getElementById("said");
const answer = document.getElementById("answer");
const downloads = document.getElementById("downloads");
const prefixes = [...document.querySelectorAll("#prefixes li")].map((item) => [item.dataset.prefix, item.dataset.namespace]);
const MOST_ROWS = 2000;
const TABLES = [["CSV", "text/csv", "csv"], ["TSV", "text/tab-separated-values", "tsv"], ["JSON", "application/sparql-results+json", "json"], ["XML", "application/sparql-results+xml", "xml"]];
const GRAPHS = [["Turtle", "text/turtle", "ttl"], ["N-Triples", "application/n-triples", "nt"], ["RDF/XML", "application/rdf+xml", "rdf"]];

const short = (iri) => {
  for (const [prefix, namespace] of prefixes) {
    const rest = iri.slice(namespace.length);
    if (iri.startsWith(namespace) && /^[\w-]+$/.test(rest)) return prefix + ":" + rest;
  }
  return iri;
};

const ask = (query, accept) => fetch("/sparql", {
  method: "POST",
  headers: { "Content-Type": "application/sparql-query", Accept: accept },
  body: query,
});

const element = (name, content) => {
  const made = document.createElement(name);
  made.textContent = content;
  return made;
};

const cell = (value) => {
  if (!value) return element("td", "");
  const made = element("td", value.type === "uri" ? short(value.value) : value.type === "bnode" ? "_:" + value.value : value.value);
  if (value.type === "uri") made.title = value.value;
  if (value.datatype && /#(integer|decimal|double)$/.test(value.datatype)) {
    made.className = "number";
    if (value.datatype.endsWith("#double")) made.textContent = String(Number(Number(value.value).toPrecision(6)));
    made.title = value.value;
  }
  return made;
};

const table = (results) => {
  const made = document.createElement("table");
  const head = made.createTHead().insertRow();
  for (const name of results.head.vars) {
    const th = element("th", name);
    th.scope = "col";
    head.append(th);
  }
  const body = made.createTBody();
  for (const row of results.results.bindings.slice(0, MOST_ROWS)) {
    const line = body.insertRow();
    for (const name of results.head.vars) line.append(cell(row[name]));
  }
  return made;
};

const show = (type, body) => {
  if (!type.includes("json")) {
    answer.replaceChildren(element("pre", body));
    return "a graph";
  }
  const results = JSON.parse(body);
  if ("boolean" in results) {
    answer.replaceChildren(element("p", String(results.boolean)));
    return "the answer";
  }
  answer.replaceChildren(table(results));
  const rows = results.results.bindings.length;
  return rows + (rows === 1 ? " row" : " rows") + (rows > MOST_ROWS ? " (showing the first " + MOST_ROWS + "; download to get all)" : "");
};

const offer = (query, forms) => {
  downloads.replaceChildren(...forms.map(([name, type, ending]) => {
    const button = element("button", "Download " + name);
    button.type = "button";
    button.addEventListener("click", async () => {
      const response = await ask(query, type);
      const body = await response.blob();
      if (!response.ok) { said.textContent = await body.text(); said.className = "bad"; return; }
      const link = document.createElement("a");
      link.href = URL.createObjectURL(body);
      link.download = "answer." + ending;
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    });
    return button;
  }));
};

form.addEventListener("submit", async (event) => {
  event.preventDefault();
  const query = text.value;
  said.className = "";
  said.textContent = "running …";
  answer.replaceChildren();
  downloads.replaceChildren();
  const began = performance.now();
  try {
    const response = await ask(query, "application/sparql-results+json, text/turtle");
    const body = await response.text();
    if (!response.ok) { said.className = "bad"; said.textContent = body; return; }
    const type = response.headers.get("Content-Type") || "";
    const what = show(type, body);
    said.textContent = what + ", " + ((performance.now() - began) / 1000).toFixed(2) + " s";
    offer(query, type.includes("json") ? TABLES : GRAPHS);
  } catch (error) {
    said.className = "bad";
    said.textContent = "no response from the server: " + error.message;
  }
});

example.addEventListener("change", () => {
  const chosen = example.selectedOptions[0];
  about.textContent = chosen.dataset.about || "";
  if (chosen.dataset.query) text.value = chosen.dataset.query;
});

text.addEventListener("keydown", (event) => {
  if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) form.requestSubmit();
});
