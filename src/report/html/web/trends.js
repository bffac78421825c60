// The history: trends from campaign to campaign.

function trends({ summary, list }) {
  const { campaigns, findings } = summary;
  const ended = (row) => row.interrupted ? "interrupted" : row.ended_by ? `ended by ${row.ended_by}` : "complete";
  const skill = (row) => row.skill === null ? "reference" : row.privileged ? `${row.skill} (received ground truth)` : row.skill;
  const changed = (property) => property.trend.changes.map((change) =>
    make("p", {}, `Since ${change.campaign} it fails in ${interval(change.behind)}, before in ${interval(change.before)} (p = ${change.p.toExponential(1)}).`));
  return [
    make("h1", {}, "History"),
    make("section", {}, scroller("Campaigns", make("table", {},
      make("thead", {}, make("tr", {}, ["campaign", "configuration", "started", "runs", "T", "without broken", "seed", "ended", "skill", "program"].map((word) => make("th", { scope: "col" }, word)))),
      make("tbody", {}, campaigns.map((row) => make("tr", {},
        make("th", { scope: "row" }, make("a", { href: list({ campaign: row.id }) }, row.id)),
        make("td", {}, row.name), make("td", {}, moment(row.started)), make("td", {}, `${count(row.runs)} of ${count(row.planned)}`),
        make("td", {}, row.score === null ? "–" : row.score.toFixed(4)), make("td", {}, row.without_broken === null ? "–" : row.without_broken.toFixed(4)),
        make("td", {}, String(row.seed)), make("td", {}, ended(row)), make("td", {}, skill(row)), make("td", {}, row.version))))))),
    campaigns.length < 2 ? make("p", {}, "There is only one campaign. With two or more, this view shows how often each property fails from campaign to campaign, and where that changed.")
      : [make("h2", {}, "How often each property fails, from campaign to campaign"),
        make("div", { class: "maps" }, findings.properties.filter((property) => property.trend.campaigns.length).map((property) => make("section", { class: "card" },
          make("h2", {}, make("small", {}, `${local(property.action)} `), local(property.property)), trendPlot(property.trend), changed(property))))],
  ];
}
