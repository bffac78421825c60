// Collisions: the things that were hit, how often, how hard, and where they were, seen from above.

/** Colours of categories, most often hit first; the last one is for all others (Okabe-Ito). */
const HIT_COLOURS = ["#d55e00", "#0072b2", "#cc79a7", "#e69f00", "#56b4e9", "#009e73", "#8a93a0"];
/** Radii of the circles around the goal, in metres. */
const RINGS = [0.1, 0.2, 0.4, 0.6, 0.8, 1.2, 1.6];

function collisions(report) {
  const actions = report.summary.findings.collisions;
  return [
    make("h1", {}, "Collisions"),
    make("p", { class: "lead" }, "Contacts of the robot, or of the object that it handles, with things that the action is not to touch, of more than 1 N. Each run of a scene that was repeated counts once."),
    actions.length ? actions.map((action) => collisionCard(report, action)) : make("p", {}, "These runs have no contacts on record."),
  ];
}

function collisionCard({ runs, list, open }, action) {
  const colour = (category) => {
    const place = action.kinds.findIndex((kind) => kind.category === category);
    return HIT_COLOURS[place < 0 ? HIT_COLOURS.length - 1 : Math.min(place, HIT_COLOURS.length - 1)];
  };
  const to = (kind) => list({ pattern: kind.name });
  return make("section", { class: "card collisions" },
    make("h2", {}, local(action.action), make("small", {}, ` hits something in ${interval(action.rate)} of ${counted(action.executions, "run")}`)),
    action.hit > 0 && [
      make("div", { class: "columns" },
        make("figure", {}, topView(runs, action, colour, open),
          make("figcaption", { class: "faint" }, "The target, or the goal of the base, is in the middle; the robot approaches upwards. Crosses were hit, the larger the harder; dots were not. Furniture is at the contact or its nearest point. Click a cross to open its run.")),
        make("div", {}, sectorTable(action))),
      hitTable(action, colour, to)]);
}

/** One row for each category that was hit. */
function hitTable(action, colour, to) {
  const most = (counts, hit) => counts.slice(0, 2).map(({ name, count: times }) => `${name.replace(/^robot\//, "")}${times === hit ? "" : ` ${times}`}`).join(", ");
  return scroller("What was hit", make("table", {},
    make("thead", {}, make("tr", {}, ["hit", "share of runs with one [95 %]", "runs", "median force", "largest", "mostly by", "mostly in", "mostly"].map((head) => make("th", { scope: "col" }, head)))),
    make("tbody", {}, action.kinds.map((kind) => make("tr", {},
      make("th", { scope: "row" }, make("span", { class: "swatch", style: { background: colour(kind.category) } }), " ",
        make("a", { href: to(kind) }, local(kind.category)), kind.furniture && make("small", {}, " furniture")),
      make("td", {}, rateCell(kind.rate)), make("td", {}, `${count(kind.hit)} of ${count(kind.present)}`),
      make("td", {}, number(kind.force_n.p50, "N")), make("td", {}, number(kind.force_n.most, "N")),
      make("td", {}, most(kind.by, kind.hit)), make("td", {}, most(kind.phases, kind.hit)), make("td", {}, most(kind.directions, kind.hit)))))));
}

/** How often movable things were hit, by direction and distance. */
function sectorTable(action) {
  const band = ({ from_m: from, to_m: to }) => to === null ? `over ${from * 100} cm` : `${Math.round(from * 100)}–${Math.round(to * 100)} cm`;
  const cell = ({ present, hit, rate }) => rate
    ? make("td", { title: `${hit} of ${present} were hit: ${interval(rate)}`, style: { "--share": rate.rate, "--sure": Math.min(1, 0.35 + present / 12) } },
      make("span", {}, `${Math.round(rate.rate * 100)}`), make("small", {}, count(present)))
    : make("td", { class: "none" }, "");
  return make("figure", { class: "heat" },
    make("figcaption", {}, "% of movable things hit, by their direction and distance from the target or goal; small: things"),
    scroller("Share hit by direction and distance", make("table", {},
      make("thead", {}, make("tr", {}, make("td", {}), action.sectors[0].map((sector) => make("th", { scope: "col" }, band(sector))))),
      make("tbody", {}, action.sectors.map((row) => make("tr", {}, make("th", { scope: "row" }, row[0].direction), row.map(cell)))))));
}

/** All things around the goal, seen from above. */
function topView(runs, action, colour, open) {
  const away = (thing) => Math.hypot(thing.beyond_m, thing.left_m);
  const hit = action.things.filter((thing) => thing.force_n !== null);
  const far = hit.map(away).sort((a, b) => a - b)[Math.max(0, Math.floor(hit.length * 0.95) - 1)] ?? 0;
  const radius = RINGS.find((ring) => ring >= far) ?? RINGS.at(-1), half = 210, scale = half / 1.1 / radius;
  const at = (thing) => [half - thing.left_m * scale, half - thing.beyond_m * scale];
  const within = (thing) => Math.max(Math.abs(thing.beyond_m), Math.abs(thing.left_m)) * scale < half;
  const cross = (thing) => {
    const [x, y] = at(thing), size = 3.5 + 1.5 * Math.log10(Math.max(1, thing.force_n));
    const told = `${thing.object}, ${number(thing.force_n, "N")}, run ${thing.run === null ? "" : runs.id(thing.run)}`;
    return make("path", { class: "hit", d: `M${x - size} ${y - size}L${x + size} ${y + size}M${x - size} ${y + size}L${x + size} ${y - size}`,
      style: { stroke: colour(thing.category) }, onclick: () => thing.run !== null && open(thing.run) }, make("title", { svg: true }, told));
  };
  const missed = action.things.filter((thing) => thing.force_n === null && within(thing));
  return make("svg", { class: "topview", viewBox: `0 0 ${2 * half} ${2 * half}`, role: "img", "aria-label": `Collisions of ${local(action.action)} from above` },
    RINGS.filter((ring) => ring <= radius).map((ring) => [
      make("circle", { class: "ring", cx: half, cy: half, r: ring * scale }),
      ring >= radius / 4 && make("text", { x: half + ring * scale * 0.71 - 4, y: half + ring * scale * 0.71 - 2, "text-anchor": "end" }, `${Math.round(ring * 100)} cm`)]),
    missed.map((thing) => make("circle", { class: "missed", cx: at(thing)[0], cy: at(thing)[1], r: 1.8 })),
    hit.filter(within).map(cross),
    make("circle", { class: "goal", cx: half, cy: half, r: 4 }),
    make("path", { class: "approach", d: `M${half} ${2 * half - 6}V${2 * half - 40}M${half - 5} ${2 * half - 32}L${half} ${2 * half - 40}L${half + 5} ${2 * half - 32}` }),
    make("text", { x: half + 10, y: 2 * half - 8 }, "the robot's approach"));
}
