// From data to what is shown.

async function main() {
  const summary = await unpack("summary");
  const table = make("table", {}, make("tr", {}, ["property", ...summary.outcomes].map((word) => make("th", {}, word))));
  for (const property of summary.findings.properties) {
    const counts = summary.outcomes.map((word) => make("td", {}, property.outcomes[word]));
    put(table, make("tr", {}, make("td", {}, `${local(property.action)} ${local(property.property)}`), counts));
  }
  fill(document.getElementById("main"), make("h1", {}, `${summary.scores.runs} runs`), table);
}

main();
