// The filter of runs, shared by the list and the map.

const ANY = { text: "", outcome: "", slot: "", campaign: "", mode: "", replay: false, pattern: null, sort: "order" };

class Filter {
  constructor(runs) {
    this.runs = runs;
    this.listeners = new Set();
    this.set({ ...ANY });
  }

  set(change) {
    Object.assign(this, change);
    this.shown = this.chosen();
    for (const listener of this.listeners) listener();
  }

  get isAny() {
    return Object.keys(ANY).every((key) => this[key] === ANY[key]);
  }

  chosen() {
    const { runs } = this;
    const words = this.text.toLowerCase().split(/\s+/).filter(Boolean);
    const letters = words.length ? runs.letters() : null;
    const outcome = OUTCOMES.indexOf(this.outcome), slot = this.slot === "" ? -1 : Number(this.slot);
    const mode = this.mode === "" ? -1 : Number(this.mode);
    const campaign = this.campaign === "" ? -1 : runs.campaign.texts.indexOf(this.campaign) + 1;
    const pattern = this.pattern && new Set(this.pattern.runs);
    const found = [];
    for (const run of runs.order) {
      if (outcome >= 0 && (slot >= 0 ? runs.outcome(run, slot) : runs.worst[run]) !== outcome) continue;
      if (slot >= 0 && runs.outcome(run, slot) === NO_OUTCOME) continue;
      if (mode >= 0 && runs.modeOf[run] !== mode) continue;
      if (campaign >= 0 && runs.campaign.of[run] !== campaign) continue;
      if (this.replay && !runs.replayed.has(runs.runs[run])) continue;
      if (pattern && !pattern.has(run)) continue;
      if (letters && !words.every((word) => letters[run].includes(word))) continue;
      found.push(run);
    }
    if (this.sort === "score") found.sort((a, b) => runs.score[a] - runs.score[b] || a - b);
    if (this.sort === "newest") found.reverse();
    return found;
  }

  /** The controls. They follow the filter, even if it is set elsewhere. */
  bar() {
    const { runs } = this;
    const choice = (name, label, options) => {
      const select = make("select", { "aria-label": label, "data-filter": name, onchange: () => this.set({ [name]: select.value }) },
        options.map(([value, words]) => make("option", { value }, words)));
      return select;
    };
    const search = make("input", {
      type: "search", placeholder: "Search runs, objects, messages …", "aria-label": "Search", "data-filter": "text",
      oninput: () => this.set({ text: search.value }),
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
      choice("sort", "Order", [["order", "in order"], ["newest", "newest first"], ["score", "worst first"]]),
    ].filter(Boolean);
    const replay = make("input", { type: "checkbox", "data-filter": "replay", onchange: () => this.set({ replay: replay.checked }) });
    const told = make("output", { class: "told", "aria-live": "polite" });
    const all = make("button", { type: "button", class: "flat", onclick: () => this.set({ ...ANY }) }, "Show all");
    const pattern = make("span", { class: "note" });
    const follow = () => {
      for (const control of controls) if (control.value !== String(this[control.dataset.filter])) control.value = this[control.dataset.filter];
      replay.checked = this.replay;
      told.textContent = `${count(this.shown.length)} of ${count(runs.count)} runs`;
      all.hidden = this.isAny;
      pattern.textContent = this.pattern ? `Only runs with ${this.pattern.told}` : "";
    };
    follow();
    const bar = make("form", { class: "filter", role: "search", onsubmit: (event) => event.preventDefault() },
      controls, make("label", { class: "check" }, replay, " in 3D"), all, told, pattern);
    return [bar, follow];
  }
}

function modeName(mode) {
  return mode.failed.length ? mode.failed.map(local).join(" + ") : "nothing failed";
}
