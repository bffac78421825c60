// The filter of runs, shared by the list and the map.

const ANY = { text: "", outcome: "", slot: "", campaign: "", mode: "", replay: false, pattern: "", sort: "order" };
/** Names of the filter's parts in an address. */
const QUERY = new Map([["q", "text"], ["outcome", "outcome"], ["property", "slot"], ["campaign", "campaign"], ["mode", "mode"],
  ["replays", "replay"], ["pattern", "pattern"], ["sort", "sort"]]);
/** Names of the filter's parts in sentences. */
const PARTS = { text: "the search", outcome: "the outcome", slot: "the property", campaign: "the campaign", mode: "the failure mode",
  replay: "“in 3D”", pattern: "the pattern" };

class Filter {
  constructor(runs) {
    this.runs = runs;
    this.listeners = new Set();
    this.sets = patternSets(runs.summary.findings);
    this.noted = () => {};
    this.set({ ...ANY });
  }

  set(change) {
    Object.assign(this, change);
    this.shown = this.chosen();
    for (const listener of this.listeners) listener();
  }

  /** Sets a choice of the user, and writes it into the address. */
  choose(change, replace = false) {
    this.set(change);
    this.noted(replace);
  }

  get isAny() {
    return Object.keys(ANY).every((key) => this[key] === ANY[key]);
  }

  /** The filter with some changes, as a query of an address. Its names remain valid if the report is generated again. */
  query(change = {}) {
    const all = { ...this, ...change }, { slots, summary } = this.runs, query = new URLSearchParams();
    const written = {
      ...all, replay: all.replay ? "1" : "", sort: all.sort === ANY.sort ? "" : all.sort,
      slot: all.slot === "" ? "" : slotKey(slots[Number(all.slot)]), mode: all.mode === "" ? "" : modeKey(summary.findings.failure_modes[Number(all.mode)]),
    };
    for (const [name, part] of QUERY) if (written[part]) query.set(name, written[part]);
    return query;
  }

  /** The filter that a query describes. Unknown values count as absent. */
  ofQuery(query) {
    const { runs } = this, modes = runs.summary.findings.failure_modes;
    const place = (list, key, name) => { const at = list.findIndex((of) => key(of) === query.get(name)); return at < 0 ? "" : String(at); };
    const one = (name, known) => known.includes(query.get(name)) ? query.get(name) : "";
    return {
      text: query.get("q") ?? "", outcome: one("outcome", OUTCOMES), campaign: one("campaign", runs.campaign.texts),
      slot: place(runs.slots, slotKey, "property"), mode: place(modes, modeKey, "mode"), replay: query.get("replays") === "1",
      pattern: one("pattern", [...this.sets.keys()]), sort: this.sortOf(query.get("sort")),
    };
  }

  /** An order by its name in an address: the column, with a minus for its reverse. */
  sortOf(name) {
    const known = ["order", "score", "happened", ...this.runs.slots.map(slotKey)];
    return name === "newest" ? "-order" : known.includes(name?.replace(/^-/, "")) ? name : ANY.sort;
  }

  /** How many runs match without one part of the filter, for each part in use. */
  withoutEach() {
    const used = Object.keys(PARTS).filter((part) => this[part] !== ANY[part]);
    const whole = Object.fromEntries(used.map((part) => [part, this[part]]));
    return used.map((part) => {
      this[part] = ANY[part];
      const matches = this.chosen().length;
      this[part] = whole[part];
      return [part, matches];
    });
  }

  chosen() {
    const { runs } = this;
    const words = this.text.toLowerCase().split(/\s+/).filter(Boolean);
    const matches = words.length ? runs.matcher(words) : null;
    const outcome = OUTCOMES.indexOf(this.outcome), slot = this.slot === "" ? -1 : Number(this.slot);
    const mode = this.mode === "" ? -1 : Number(this.mode);
    const campaign = this.campaign === "" ? -1 : runs.campaign.texts.indexOf(this.campaign) + 1;
    const replayed = this.replay && !runs.summary.served && new Set([...runs.replayed.keys()].map((id) => runs.find(id)));
    const pattern = this.pattern && new Set(this.sets.get(this.pattern).runs);
    const found = [];
    for (const run of runs.sortedBy(this.sort)) {
      if (outcome >= 0 && (slot >= 0 ? runs.outcome(run, slot) : runs.worst[run]) !== outcome) continue;
      if (slot >= 0 && runs.outcome(run, slot) === NO_OUTCOME) continue;
      if (mode >= 0 && runs.mode[run] !== mode + 1) continue;
      if (campaign >= 0 && runs.campaign.of[run] !== campaign) continue;
      if (replayed && !replayed.has(run)) continue;
      if (pattern && !pattern.has(run)) continue;
      if (matches && !matches(run)) continue;
      found.push(run);
    }
    return found;
  }

  /** The controls. They follow the filter, even if it is set elsewhere. */
  bar() {
    const { runs } = this;
    const choice = (name, label, options) => {
      const select = make("select", { "aria-label": label, "data-filter": name, onchange: () => this.choose({ [name]: select.value }) },
        options.map(([value, words]) => make("option", { value }, words)));
      return select;
    };
    const search = make("input", {
      type: "search", placeholder: "Search runs, objects, messages …", "aria-label": "Search", "data-filter": "text",
      oninput: () => this.choose({ text: search.value }, this.text !== ""),
    });
    const modes = runs.summary.findings.failure_modes;
    const controls = [
      search,
      choice("outcome", "Outcome", [["", "any outcome"], ...OUTCOMES.map((word) => [word, word])]),
      choice("slot", "Property", [["", "of any property"], ...runs.slots.map((slot, i) => [i, `${slot.action} · ${slot.property}`])]),
      modes.length > 1 && choice("mode", "Failure mode", [["", "any failure mode"],
        ...modes.map((mode, i) => [i, modeName(mode)])]),
      runs.campaign.texts.length > 1 && choice("campaign", "Campaign", [["", "all campaigns"],
        ...runs.campaign.texts.map((id) => [id, id])]),
      choice("sort", "Order", [["order", "in order"], ["-order", "newest first"], ["score", "worst first"], ["-score", "best first"], ["happened", "by what happened"], ["-happened", "by what happened, from Z"],
        ...runs.slots.flatMap((slot) => [[slotKey(slot), `${slot.property}, failed first`], [`-${slotKey(slot)}`, `${slot.property}, failed last`]])]),
    ].filter(Boolean);
    const replay = make("input", { type: "checkbox", "data-filter": "replay", onchange: () => this.choose({ replay: replay.checked }) });
    const told = make("output", { class: "told", "aria-live": "polite" });
    const all = make("button", { type: "button", class: "flat", onclick: () => this.choose({ ...ANY }) }, "Show all");
    const pattern = make("span", { class: "note" });
    const follow = () => {
      for (const control of controls) if (control.value !== String(this[control.dataset.filter])) control.value = this[control.dataset.filter];
      replay.checked = this.replay;
      told.textContent = `${count(this.shown.length)} of ${count(runs.count)} runs`;
      all.hidden = this.isAny;
      pattern.textContent = this.pattern ? `Only runs with ${this.sets.get(this.pattern).told}` : "";
    };
    follow();
    const bar = make("form", { class: "filter", role: "search", onsubmit: (event) => event.preventDefault() },
      controls, !runs.summary.served && make("label", { class: "check" }, replay, " in 3D"), all, told, pattern);
    return [bar, follow];
  }
}

/** A note for an empty list: the parts of the filter without which runs match, and a button that clears it. Hidden if a run matches. */
function noMatch(filter) {
  const element = make("div", { class: "empty card", role: "status", hidden: true });
  const follow = () => {
    element.hidden = filter.shown.length > 0;
    if (element.hidden) return fill(element);
    if (filter.isAny) return fill(element, make("p", {}, "This report has no runs."));
    const ways = filter.withoutEach().filter(([, matches]) => matches > 0);
    return fill(element, make("p", {}, make("b", {}, "No run matches this filter.")),
      ways.length > 0 && make("ul", {}, ways.map(([part, matches]) => make("li", {},
        make("button", { type: "button", class: "flat", onclick: () => filter.choose({ [part]: ANY[part] }) }, `Without ${PARTS[part]}`), ` ${counted(matches, "run")} ${matches === 1 ? "matches" : "match"}.`))),
      make("p", {}, make("button", { type: "button", onclick: () => filter.choose({ ...ANY }) }, "Clear the filters")));
  };
  follow();
  return [element, follow];
}

/** The runs of each pattern and each kind of collision, by their names in addresses. */
function patternSets(findings) {
  const sets = new Map();
  const put = (name, runs, told) => { if (!sets.has(name)) sets.set(name, { runs, told, name }); };
  for (const property of findings.properties) {
    for (const kind of ["patterns", "effects"]) {
      for (const pattern of property[kind].found) {
        const told = pattern.sentence.replace(/^.* runs with /, "").replace(/; elsewhere.*$/, "");
        pattern.name = `${local(property.action)}.${local(property.property)}: ${told}`;
        put(pattern.name, pattern.runs, told);
      }
    }
  }
  for (const action of findings.collisions) {
    for (const kind of action.kinds) {
      kind.name = `${local(action.action)} hits ${local(kind.category)}`;
      put(kind.name, kind.runs, kind.name);
    }
  }
  return sets;
}

function slotKey(slot) {
  return slot && `${slot.step}.${slot.action}.${slot.property}`;
}

function modeKey(mode) {
  return mode && (mode.failed.map(local).join("+") || "nothing");
}

function modeName(mode) {
  return mode.failed.length ? mode.failed.map(local).join(" + ") : "nothing failed";
}
