// The view of one run: failures with explanations, timeline, scene and 3D replay.

function runView({ runs, summary, filter, address, to }, id) {
  const run = runs.find(id);
  if (run === undefined) return { parts: [make("h1", {}, "No such run"), make("p", {}, `This report has no run ${id}. `, make("a", { href: address.of("runs") }, "See all runs"))] };
  const at = filter.shown.indexOf(run);
  const step = (by, words) => {
    const other = at >= 0 ? filter.shown[at + by] : undefined;
    return other !== undefined && make("a", { class: "button", href: to(other) }, words);
  };
  const place = make("div", { class: "watch" });
  const details = make("div", { class: "details" });
  const worst = OUTCOMES[runs.worst[run]];
  const failed = runs.failures(run);
  const parts = [
    make("header", { class: "runhead" },
      make("h1", {}, id, " ", badge(worst, worst === "passed" ? "nothing failed" : worst)),
      make("nav", { "aria-label": "Other runs" }, step(-1, "← previous"), step(1, "next →"), runs.canPlay(id) && make("a", { class: "button", href: address.of("pair", id) }, "side by side"), make("a", { class: "button", href: address.of("runs") }, filter.isAny ? "all runs" : "these runs"))),
    make("p", { class: "lead" }, `${runs.text(runs.test, run)} · S = ${Number.isNaN(runs.score[run]) ? "–" : runs.score[run].toFixed(2)} · campaign ${runs.text(runs.campaign, run)} · ${moment(runs.told(runs.started, run))} · ${runs.text(runs.status, run)}`),
    summary.contested[id] && make("p", { class: "note" }, `Contested: MuJoCo, or one of its settings, decides ${summary.contested[id].join(", ")} otherwise (actcheck cross-check).`),
    make("div", { class: "run" }, place, details),
    repeats(summary, id),
    parameterTable(runs, run),
  ];
  fill(details, failed.length > 0 && make("p", { class: "perceived" }, runs.happened(run)), runs.slots.map((slot, i) => [slot, i]).filter(([, i]) => failed.includes(i)).map(([slot, i]) => failure(runs, run, slot, i)),
    allOutcomes(runs, run));
  const known = { end: () => {} };
  if (!runs.canPlay(id)) {
    put(place, notHere());
    return { parts, end: () => known.end() };
  }
  put(place, make("p", { class: "waiting" }, "Unpacking the run …"));
  watch(known, place, details, { runs, run, id, address }).catch((error) =>
    fill(place, make("p", { class: "note" }, `Can't show this run in 3D: ${error.message}`)));
  return { parts, end: () => known.end(), arrive: (query) => known.arrive?.(secsOf(query)) };
}

/** The moment that an address asks for, in seconds; `null` if it asks for none. */
function secsOf(query) {
  const secs = Number.parseFloat(query.get("t") ?? "");
  return Number.isFinite(secs) ? secs : null;
}

async function watch(known, place, details, { runs, run, id, address }) {
  const { replay, forms } = await replayOf(runs, id);
  let ended = false, shown = null;
  known.end = () => { ended = true; shown?.end(); };
  const seek = (secs) => shown?.seek(secs);
  const asked = new Set(runs.slots.map((slot) => slot.iri));
  const told = (judged) => judged.outcome === "failed" && asked.has(judged.property);
  fill(details, replay.actions.map((action) => [action.perceived && action.judged.some(told) && make("p", { class: "perceived" }, `${action.perceived}.`),
    action.judged.filter(told).map((judged) => explained(action, judged, seek))]), actionsOf(replay), allOutcomes(runs, run), objectTable(replay), discards(replay));
  if (!replay.courses || !replay.courses.frames) {
    return fill(place, make("p", { class: "note" }, replay.reason ? `The run was ${runs.text(runs.status, run)}: ${replay.reason}` : "The trace of this run is missing or corrupt."));
  }
  const usual = () => decidedAt(replay, asked);
  const made = await player([{ replay, forms, slots: unitsOf(runs) }], (secs) => address.note({ t: secs.toFixed(2) }));
  if (ended) return made.end();
  shown = made;
  fill(place, made.element);
  made.begin(secsOf(wayOf(location.hash).query) ?? usual());
  known.arrive = (secs) => made.seek(secs ?? usual());
  place.dataset.ready = "true";
  return undefined;
}

/** The moment that decided a run: the first one of its failed properties; of a run in which nothing failed, its beginning. Unit: seconds. */
function decidedAt(replay, asked) {
  const action = replay.actions.find(({ judged }) => judged.some(({ outcome, property }) => outcome === "failed" && asked.has(property)));
  const failed = (action?.judged ?? []).filter(({ outcome, property }) => outcome === "failed" && asked.has(property));
  const moments = failed.map(({ decided }) => decided).filter((secs) => typeof secs === "number");
  return moments.length ? Math.min(...moments) : 0;
}

/** The judged properties with the units of their margins. */
function unitsOf(runs) {
  return runs.slots.map((slot) => ({ ...slot, unit: runs.summary.findings.properties[slot.of]?.margin.unit }));
}

/** A failed property, with the data of the tables. */
function failure(runs, run, slot, i) {
  return make("section", { class: "card failure" }, make("h2", {}, sign("failed"), make("small", {}, ` ${slot.action} `), slot.property),
    make("p", {}, runs.why(run, i)),
    make("p", { class: "faint" }, slot.comment || slot.label, runs.margins[i] && !Number.isNaN(runs.margins[i][run]) && ` · margin ${number(runs.margins[i][run])}`));
}

/** A failed property with its explanation and its moment, from the replay. */
function explained(action, judged, seek) {
  return make("section", { class: "card failure" },
    make("h2", {}, sign("failed"), make("small", {}, ` ${local(action.action)} `), local(judged.property)),
    make("p", {}, judged.witness),
    judged.pressed && make("p", { class: "pressed" }, judged.pressed),
    make("p", { class: "faint" }, judged.margin !== null && `margin ${number(judged.margin)} `,
      judged.event && momentButton(judged.decided, judged.event, seek),
      momentButton(judged.stated, judged.event ? "the state after the action" : "show the moment", seek)),
    judged.why && make("details", {}, make("summary", {}, "Why"), make("div", { class: "proof", tabindex: "0", role: "group", "aria-label": "Proof" }, judged.why.split("\n").filter((line) => line.trim()).map(proofLine))));
}

function momentButton(secs, words, seek) {
  return typeof secs === "number" && make("button", { type: "button", class: "flat", onclick: () => seek(secs) }, `${words} (${secs.toFixed(1)} s)`);
}

/** A line of an explanation: missing facts are highlighted, citations are dimmed. */
function proofLine(line) {
  const text = line.trimStart(), depth = (line.length - text.length) / 2;
  const kind = /^(missing|missed|blocked)/.test(text) ? "missing" : /^ok /.test(text) ? "ok" : /^nearest/.test(text) ? "nearest" : "";
  const [said, cited] = text.split(/ (?=(?:came closest )?by \S+:\d+)/);
  return make("div", { class: `line ${kind}`, style: { "padding-left": `${depth * 1.1 + 1}em` } }, said, cited && make("span", { class: "faint" }, ` ${cited}`));
}

function actionsOf(replay) {
  return make("section", {}, make("h2", {}, "Actions"), make("ol", { class: "actions" }, replay.actions.map((action) => make("li", {},
    make("b", {}, local(action.action)), ` ${action.end}, ${number(action.seconds, "s")}`,
    make("div", { class: "faint" }, action.reported === null ? "" : action.reported ? "reported success" : "reported failure", action.message && `: ${action.message}`),
    Object.entries(action.parameters).map(([name, values]) => make("div", { class: "faint" }, `${name} = ${values.map(local).join(", ")}`))))));
}

function allOutcomes(runs, run) {
  return make("section", {}, make("h2", {}, "Outcomes"), make("ul", { class: "outcomes" }, runs.slots.map((slot, i) => {
    const outcome = runs.outcome(run, i);
    if (outcome === NO_OUTCOME) return null;
    const margin = runs.margins[i]?.[run];
    return make("li", { title: slot.comment ?? "" }, sign(OUTCOMES[outcome]), make("small", {}, ` ${slot.action} `), slot.property,
      margin !== undefined && !Number.isNaN(margin) && make("span", { class: "faint" }, ` ${number(margin)}`));
  })));
}

function objectTable(replay) {
  return make("section", {}, make("h2", {}, "Scene"), make("p", { class: "faint" }, `world ${replay.world}, seed ${replay.seed}, program ${replay.program}`),
    scroller("Objects of the scene", make("table", {},
      make("thead", {}, make("tr", {}, ["object", "kind", "role", "mass (kg)", "friction", "displacement (m)", "tilt (rad)"].map((word) => make("th", { scope: "col" }, word)))),
      make("tbody", {}, replay.objects.map((object) => make("tr", { class: object.role === "target" ? "strong" : "" },
        make("th", { scope: "row" }, object.id), make("td", {}, object.kind), make("td", {}, object.role),
        [object.mass, object.friction, object.moved, object.tilt].map((value) => make("td", {}, number(value)))))))));
}

function discards(replay) {
  return replay.discards.length > 0 && make("p", { class: "faint" }, `${replay.discards.length} scenes before it were discarded: ${[...new Set(replay.discards)].join("; ")}`);
}

function parameterTable(runs, run) {
  const known = runs.parameters.map((parameter) => [parameter, runs.value(parameter.name, run)]).filter(([, value]) => value !== "" && !Number.isNaN(value));
  const lists = [["Parameters of the scene", ["scene"]], ["Errors drawn", ["noise"]], [`Effects during ${local(runs.told(runs.action, run))}`, ["effect", "record"]]];
  return lists.map(([title, roles]) => {
    const listed = known.filter(([parameter]) => roles.includes(parameter.role));
    return listed.length > 0 && make("section", {}, make("h2", {}, title), make("dl", { class: "parameters" }, listed.map(([parameter, value]) => make("div", { title: parameter.told },
      make("dt", {}, parameter.label), make("dd", {}, typeof value === "number" ? number(value, parameter.unit) : value)))));
  });
}

/** The commands that repeat a run. */
function repeats(summary, id) {
  const { program, of_history } = summary, asked = `${quoted(id)} ${of_history}`;
  return make("section", { class: "repeats" }, make("h2", {}, "Repeat this run"),
    [["Simulate it again, and check that it is the same:", `replay ${asked}`], ["Print it, with a picture:", `show ${asked} --picture ${quoted(`${id}.png`)}`], ["Prove its outcomes:", `why ${asked}`]]
      .map(([told, words]) => [make("p", { class: "faint" }, told), command(`${program} ${words}`)]));
}

function notHere() {
  return make("p", { class: "note card" }, "This run has no replay in this file, which only has space for some runs of each failure mode and property. The commands below show it, and actcheck serve plays every run.");
}
