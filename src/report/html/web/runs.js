// All runs as columns, with queries on single runs.

class Runs {
  constructor(columns, summary) {
    Object.assign(this, columns);
    this.summary = summary;
    this.count = columns.runs.length;
    this.searched = [];
    this.slots = summary.slots;
    this.place = new Map(columns.runs.map((id, run) => [id, run]));
    this.replayed = new Map(summary.replays.map((id, number) => [id, number]));
    this.parameter = new Map(columns.parameters.map((parameter) => [parameter.name, parameter]));
    this.witness = new Map();
    columns.witnesses.at.forEach((at, i) => this.witness.set(at, columns.witnesses.texts[i]));
    this.modeOf = new Int32Array(this.count).fill(-1);
    summary.findings.failure_modes.forEach((mode, number) => mode.runs.forEach((run) => { this.modeOf[run] = number; }));
    const none = new Float64Array(this.count).fill(NaN);
    this.score ??= none;
    this.index ??= none;
    // By campaign, then by index. Alphabetical order of ids would be neither.
    this.order = Array.from({ length: this.count }, (_, run) => run)
      .sort((a, b) => this.campaign.of[a] - this.campaign.of[b] || this.index[a] - this.index[b] || a - b);
    this.worst = Uint8Array.from({ length: this.count }, (_, run) => this.worstOf(run));
  }

  outcome(run, slot) {
    return this.outcomes[slot * this.count + run];
  }

  /** Outcome of a whole run: failed if any property failed, else the outcome that kept it from being judged, else passed. */
  worstOf(run) {
    const seen = new Set();
    for (let slot = 0; slot < this.slots.length; slot++) seen.add(this.outcome(run, slot));
    for (const outcome of [FAILED, BROKEN, TIMEOUT, PASSED, 2, 5]) if (seen.has(outcome)) return outcome;
    return 5;
  }

  text(column, run) {
    const place = column.of[run];
    return place ? column.texts[place - 1] : "";
  }

  /** A parameter of a run: a string or a number. */
  value(name, run) {
    const parameter = this.parameter.get(name);
    if (!parameter) return NaN;
    return parameter.values.kind === "texts" ? this.text(parameter.values, run) : parameter.values[run];
  }

  failures(run) {
    return this.slots.map((_, slot) => slot).filter((slot) => this.outcome(run, slot) === FAILED);
  }

  why(run, slot) {
    return this.witness.get(slot * this.count + run) ?? "";
  }

  /** Counts of each outcome in some runs, over all properties or for one. */
  counts(runs, only) {
    const sums = new Float64Array(256);
    for (let slot = 0; slot < this.slots.length; slot++) {
      if (only !== undefined && slot !== only) continue;
      const base = slot * this.count;
      for (const run of runs) sums[this.outcomes[base + run]]++;
    }
    return Object.fromEntries(OUTCOMES.map((word, i) => [word, sums[i]]));
  }

  /** Searchable text of all runs, in lower case. Builds missing entries. */
  letters() {
    this.gather(this.count);
    return this.searched;
  }

  /** Builds the searchable text of some more runs. Returns whether all are done. */
  gather(some) {
    const end = Math.min(this.count, this.searched.length + some);
    for (let run = this.searched.length; run < end; run++) this.searched.push(this.lettersOf(run));
    return end === this.count;
  }

  lettersOf(run) {
    const words = [this.runs[run], this.text(this.test, run), this.text(this.status, run), this.text(this.campaign, run)];
    for (const parameter of this.parameters) if (parameter.values.kind === "texts") words.push(this.text(parameter.values, run));
    for (const step of this.steps) words.push(this.text(step.message, run));
    for (let slot = 0; slot < this.slots.length; slot++) {
      const outcome = this.outcome(run, slot);
      if (outcome === FAILED) words.push(this.slots[slot].property, this.why(run, slot));
    }
    return words.join(" ").toLowerCase();
  }
}
