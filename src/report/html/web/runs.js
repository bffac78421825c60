// All runs as columns, with queries on single runs.

/** Number of runs from which their texts are not collected for the search. */
const MANY_RUNS = 50000;

class Runs {
  constructor(columns, summary) {
    Object.assign(this, columns);
    this.summary = summary;
    this.searched = [];
    this.gathered = 0;
    this.slots = summary.slots;
    this.replayed = new Map(summary.replays.map((id, number) => [id, number]));
    this.parameter = new Map(columns.parameters.map((parameter) => [parameter.name, parameter]));
    this.witness = new Map();
    columns.witnesses.at.forEach((at, i) => this.witness.set(at, columns.witnesses.texts[i]));
    // Place of each run in the sample whose parameters and texts are in the page; without one, the page has those of all runs.
    this.sampled = columns.detailed ? new Int32Array(this.count).fill(-1) : null;
    columns.detailed?.forEach((run, place) => { this.sampled[run] = place; });
    const none = () => new Float64Array(this.count).fill(NaN);
    this.score ??= none();
    this.index ??= none();
    this.order = this.ordered();
    this.judge();
  }

  /** Whether a run can be played back: its replay is in the page, or the server has it. */
  canPlay(id) {
    return this.summary.served || this.replayed.has(id);
  }

  /** Runs by campaign, then by index. Alphabetical order of ids would be neither. */
  ordered() {
    const { index, campaign } = this, order = Uint32Array.from({ length: this.count }, (_, run) => run);
    const compare = (a, b) => campaign.of[a] - campaign.of[b] || index[a] - index[b] || a - b;
    for (let run = 1; run < order.length; run++) if (compare(run - 1, run) > 0) return order.sort(compare);
    return order;
  }

  /** Runs by score, the worst first, those without a score last. */
  byScore() {
    if (!this.worstFirst) {
      const groups = new Map();
      for (let run = 0; run < this.count; run++) {
        const score = this.score[run], group = groups.get(score);
        if (group) group.push(run);
        else groups.set(score, [run]);
      }
      const scores = [...groups.keys()].sort((a, b) => (Number.isNaN(a) ? 2 : a) - (Number.isNaN(b) ? 2 : b));
      this.worstFirst = scores.flatMap((score) => groups.get(score));
    }
    return this.worstFirst;
  }

  /** The outcome of each whole run: failed if any property failed, else the outcome that kept it from being judged, else passed. And the
   * set of its failed properties, as a number. */
  judge() {
    const rank = [3, 0, 4, 1, 2, 5], strongest = [FAILED, BROKEN, TIMEOUT, PASSED, 2, 5];
    const least = new Uint8Array(this.count).fill(5);
    this.failed = new Float64Array(this.count);
    for (let slot = 0; slot < this.slots.length; slot++) {
      const base = slot * this.count, bit = 2 ** (slot % 50);
      for (let run = 0; run < this.count; run++) {
        const outcome = this.outcomes[base + run];
        if (outcome === NO_OUTCOME) continue;
        if (rank[outcome] < least[run]) least[run] = rank[outcome];
        if (outcome === FAILED) this.failed[run] += bit;
      }
    }
    this.worst = least.map((place) => strongest[place]);
  }

  outcome(run, slot) {
    return this.outcomes[slot * this.count + run];
  }

  id(run) {
    return this.ids ? this.ids[run] : `${this.text(this.campaign, run)}-${this.index[run] + 1}`;
  }

  /** The run with an id; `undefined` if there is none. */
  find(id) {
    if (this.ids) {
      this.place ??= new Map(this.ids.map((one, run) => [one, run]));
      return this.place.get(id);
    }
    const [, name, number] = /^(.*)-(\d+)$/.exec(id) ?? [];
    const campaign = this.campaign.texts.indexOf(name) + 1, index = Number(number) - 1;
    let low = 0, high = this.count;
    while (low < high) {
      const middle = (low + high) >> 1, run = this.order[middle];
      if (this.campaign.of[run] - campaign < 0 || (this.campaign.of[run] === campaign && this.index[run] < index)) low = middle + 1;
      else high = middle;
    }
    const run = this.order[low];
    return run !== undefined && this.id(run) === id ? run : undefined;
  }

  /** Place of a run in columns of parameters and texts; -1 if the page has none of it. */
  detail(run) {
    return this.sampled ? this.sampled[run] : run;
  }

  /** The runs with parameters and texts. */
  get details() {
    return this.detailed ?? this.order;
  }

  text(column, run) {
    const place = column.of[run];
    return place ? column.texts[place - 1] : "";
  }

  /** A text of a run in a column that only has those of the sample; empty if the page lacks it. */
  told(column, run) {
    const at = this.detail(run);
    return at < 0 ? "" : this.text(column, at);
  }

  /** A parameter of a run: a string or a number. */
  value(name, run) {
    const parameter = this.parameter.get(name), at = this.detail(run);
    if (!parameter || at < 0) return NaN;
    return parameter.values.kind === "texts" ? this.text(parameter.values, at) : parameter.values[at];
  }

  failures(run) {
    return this.slots.map((_, slot) => slot).filter((slot) => this.outcome(run, slot) === FAILED);
  }

  /** The objects of a run: `bottle (Bottle)`. Empty if the page lacks them. */
  objectsOf(run) {
    const { objects } = this, at = this.detail(run);
    if (!objects || at < 0) return [];
    return Array.from(objects.of.subarray(objects.ends[at - 1] ?? 0, objects.ends[at]), (item) => objects.items[item]);
  }

  /**
   * What happened in a run, in a sentence: of a failed run, how far off the target was perceived, then the failure that the
   * action reported, or else the first failed property; of others, the last message.
   */
  happened(run) {
    const failed = this.failures(run), at = this.detail(run);
    if (!failed.length || at < 0) return failed.map((slot) => this.why(run, slot)).find(Boolean) ?? this.steps.map((step) => this.told(step.message, run)).filter(Boolean).at(-1) ?? "";
    const step = this.steps[this.slots[failed[0]].step - 1], reported = step?.reported?.[at] === 0 && this.text(step.message, at);
    return [step?.perceived && this.text(step.perceived, at), reported || failed.map((slot) => this.why(run, slot)).find(Boolean)].filter(Boolean).join("; ");
  }

  /** Runs in the order of a column: of their ids, `score`, `happened`, or the key of a slot, whose failures come first. A minus before it turns it around. */
  sortedBy(sort) {
    const isBackward = sort.startsWith("-"), key = isBackward ? sort.slice(1) : sort;
    const slot = this.slots.findIndex((one) => slotKey(one) === key);
    const found = key === "score" ? this.byScore() : key === "happened" ? this.byText() : slot >= 0 ? this.bySlot(slot) : this.order;
    return isBackward ? [...found].reverse() : found;
  }

  byText() {
    this.alphabetical ??= [...this.order].map((run) => [this.happened(run), run]).sort(([a], [b]) => a < b ? -1 : a > b ? 1 : 0).map(([, run]) => run);
    return this.alphabetical;
  }

  /** Runs by their outcome of a property: failed ones first, by their margin, and those without the property last. */
  bySlot(slot) {
    const rank = { 255: 9, [FAILED]: 0, [BROKEN]: 1, [TIMEOUT]: 2, [PASSED]: 3 }, margins = this.margins[slot];
    const key = (run) => [rank[this.outcome(run, slot)] ?? 5, margins && !Number.isNaN(margins[run]) ? margins[run] : Infinity];
    return [...this.order].map((run) => [...key(run), run]).sort((a, b) => a[0] - b[0] || (a[1] === b[1] ? 0 : a[1] - b[1])).map(([, , run]) => run);
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

  /** A test of whether a run has all of some words, which are in lower case. */
  matcher(words) {
    if (this.count <= MANY_RUNS) {
      this.gather(this.count);
      return (run) => words.every((word) => this.searched[run].includes(word));
    }
    // Runs with the same test, status, campaign and failed properties have the same words, except for their ids and details.
    const alike = new Map(), { test, status, campaign, failed } = this;
    const lacking = (run) => {
      const kind = (campaign.of[run] * (test.texts.length + 1) + test.of[run]) * (status.texts.length + 1) + status.of[run];
      let sets = alike.get(kind);
      if (!sets) alike.set(kind, sets = new Map());
      let found = sets.get(failed[run]);
      if (!found) {
        const text = [...this.words(run), ...this.failures(run).map((slot) => this.slots[slot].property)].join(" ").toLowerCase();
        sets.set(failed[run], found = words.filter((word) => !text.includes(word)));
      }
      return found;
    };
    return (run) => {
      const rest = lacking(run);
      if (!rest.length) return true;
      const id = this.id(run).toLowerCase(), more = this.detail(run) >= 0 ? this.searched[run] ??= this.lettersOf(run) : "";
      return rest.every((word) => id.includes(word) || more.includes(word));
    };
  }

  /** Builds the searchable text of some more runs. Returns whether all are done. */
  gather(some) {
    if (this.count > MANY_RUNS) {
      const runs = this.detailed ?? [], end = Math.min(runs.length, this.gathered + some);
      for (; this.gathered < end; this.gathered++) this.searched[runs[this.gathered]] ??= this.lettersOf(runs[this.gathered]);
      return this.gathered >= runs.length;
    }
    const end = Math.min(this.count, this.searched.length + some);
    for (let run = this.searched.length; run < end; run++) this.searched.push(this.lettersOf(run));
    return end === this.count;
  }

  words(run) {
    return [this.text(this.test, run), this.text(this.status, run), this.text(this.campaign, run)];
  }

  lettersOf(run) {
    const words = [this.id(run), ...this.words(run)], at = this.detail(run);
    if (at >= 0) {
      for (const parameter of this.parameters) if (parameter.values.kind === "texts") words.push(this.text(parameter.values, at));
      for (const step of this.steps) words.push(this.text(step.message, at));
      words.push(...this.objectsOf(run), this.happened(run));
    }
    for (const slot of this.failures(run)) words.push(this.slots[slot].property, this.why(run, slot));
    return words.join(" ").toLowerCase();
  }
}
