// Two runs side by side, in step.

/** Runs that are offered as the other one. */
const MOST_OFFERED = 2000;

function pairView(report, left, right) {
  const { runs, address, to } = report;
  const first = runs.find(left), second = right === undefined ? otherOf(runs, first) : runs.find(right);
  const choose = (words, id, change) => {
    const input = make("input", { type: "search", list: "runs-offered", value: id, "aria-label": `${words} run`, onchange: () => {
      const isKnown = runs.find(input.value) !== undefined;
      input.setCustomValidity(isKnown ? "" : "This report has no such run.");
      if (isKnown) location.hash = change(input.value);
      else input.reportValidity();
    } });
    return make("label", {}, `${words} `, input);
  };
  const offered = Array.from(runs.order).filter((run) => runs.canPlay(runs.id(run))).slice(0, MOST_OFFERED);
  const ids = [first, second].map((run) => run === undefined ? "" : runs.id(run));
  const bar = make("p", { class: "filter" }, choose("Left", ids[0], (id) => address.of("pair", id, ids[1])), choose("Right", ids[1], (id) => address.of("pair", ids[0], id)),
    make("a", { class: "button", href: address.of("pair", ids[1], ids[0]) }, "swap"),
    make("datalist", { id: "runs-offered" }, offered.map((run) => make("option", { value: runs.id(run) }, OUTCOMES[runs.worst[run]]))));
  const parts = [make("h1", {}, "Side by side"), bar];
  if (first === undefined || second === undefined) {
    return { parts: [...parts, make("p", { class: "note" }, first === undefined ? `This report has no run ${left}.` : right === undefined ? "There is no other run to compare with." : `This report has no run ${right}.`)] };
  }
  const place = make("div", { class: "watch" }, make("p", { class: "waiting" }, "Unpacking the runs …"));
  const known = { end: () => {} };
  watchPair(known, place, report, [first, second]).catch((error) => fill(place, make("p", { class: "note" }, `Can't show these runs in 3D: ${error.message}`)));
  return {
    parts: [...parts, place, make("section", {}, make("h2", {}, "Outcomes"), pairTable(runs, [first, second], to))],
    end: () => known.end(), arrive: (query) => known.arrive?.(secsOf(query)), wide: true,
  };
}

/** A run to lay beside another one: of the same test, and better if that one failed, else worse. */
function otherOf(runs, run) {
  if (run === undefined) return undefined;
  const playable = Array.from(runs.order).filter((other) => other !== run && runs.canPlay(runs.id(other)) && runs.test.of[other] === runs.test.of[run]);
  return playable.find((other) => (runs.worst[other] === FAILED) !== (runs.worst[run] === FAILED)) ?? playable[0];
}

async function watchPair(known, place, { runs, address }, pair) {
  let ended = false, shown = null;
  known.end = () => { ended = true; shown?.end(); };
  const found = await Promise.all(pair.map((run) => replayOf(runs, runs.id(run))));
  const asked = new Set(runs.slots.map((slot) => slot.iri)), bare = found.findIndex(({ replay }) => !replay.courses?.frames);
  if (bare >= 0) throw new Error(`the trace of ${runs.id(pair[bare])} is missing or corrupt`);
  const sides = found.map(({ replay, forms }, i) => ({ replay, forms, slots: unitsOf(runs), name: `${runs.id(pair[i])}: ${OUTCOMES[runs.worst[pair[i]]]}` }));
  const made = await player(sides, (secs) => address.note({ t: secs.toFixed(2) }));
  if (ended) return made.end();
  shown = made;
  fill(place, made.element);
  const moments = found.map(({ replay }) => decidedAt(replay, asked)).filter((secs) => secs > 0), usual = moments.length ? Math.min(...moments) : 0;
  made.begin(secsOf(wayOf(location.hash).query) ?? usual);
  known.arrive = (secs) => made.seek(secs ?? usual);
  place.dataset.ready = "true";
  return undefined;
}

/** The cause and each property in both runs. Rows that differ are marked. */
function pairTable(runs, pair, to) {
  const cell = (run, i) => {
    const outcome = runs.outcome(run, i), margin = runs.margins[i]?.[run];
    return make("td", {}, outcome === NO_OUTCOME ? "–" : [sign(OUTCOMES[outcome]), margin !== undefined && !Number.isNaN(margin) && ` ${number(margin)}`]);
  };
  return scroller("Outcomes of both runs", make("table", { class: "both" },
    make("thead", {}, make("tr", {}, make("th", { scope: "col" }, "property"), pair.map((run) => make("th", { scope: "col" }, make("a", { href: to(run) }, runs.id(run)))))),
    make("tbody", {}, make("tr", {}, make("th", { scope: "row" }, "what happened"), pair.map((run) => make("td", { class: "prose" }, runs.happened(run)))),
      runs.slots.map((slot, i) => make("tr", { class: runs.outcome(pair[0], i) === runs.outcome(pair[1], i) ? "" : "strong" },
        make("th", { scope: "row" }, make("small", {}, `${slot.action} `), slot.property), pair.map((run) => cell(run, i)))))));
}
