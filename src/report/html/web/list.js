// The matrix of runs × properties. Only the visible rows are in the DOM.

/** Height of a row of one line. Unit: pixels. */
const SHORT_ROW = 32;
const MORE = 12;
/** Largest height of an element that all browsers draw, in pixels. */
const TALLEST = 15000000;

/** Height of a row where the words are below the outcomes. Unit: pixels. */
const TALL_ROW = 66;
/** Width of the window below which they are. Unit: pixels. */
const NARROW = 700;

function runList({ runs, filter, to }) {
  const body = make("div", { class: "rows", role: "rowgroup" });
  const heads = [];
  // A click on a head sorts by its column: as named, then turned around, then in order again.
  const sorts = (key, element, words) => {
    const button = make("button", { type: "button", class: "flat sorts", title: `Sort by ${words}`, onclick: () => filter.choose({ sort: { [key]: `-${key}`, [`-${key}`]: ANY.sort }[filter.sort] ?? key }) });
    button.append(...element.childNodes);
    element.append(button);
    heads.push([key, element]);
    return element;
  };
  const followSort = () => heads.forEach(([key, element]) => {
    const order = { [key]: "ascending", [`-${key}`]: "descending" }[filter.sort];
    if (order) element.setAttribute("aria-sort", order);
    else element.removeAttribute("aria-sort");
  });
  const head = make("div", { class: "row head", role: "row" },
    sorts("order", make("span", { class: "id", role: "columnheader" }, "run"), "run"), sorts("score", make("span", { class: "score", role: "columnheader" }, "S"), "score S"),
    runs.slots.map((slot) => sorts(slotKey(slot), make("span", { class: "cell", role: "columnheader", title: `${slot.action}: ${slot.property}` },
      make("span", { class: "turned" }, slot.property)), slot.property)),
    sorts("happened", make("span", { class: "words", role: "columnheader" }, "what happened"), "what happened"));
  const list = make("div", { class: "list", role: "grid", tabindex: "0", "aria-label": "Runs and their outcomes",
    "aria-rowcount": runs.count }, head, body);
  const isNarrow = () => innerWidth < NARROW;
  let rowHeight = isNarrow() ? TALL_ROW : SHORT_ROW;
  let active = -1;
  const shownRows = new Map();

  const row = (at) => {
    const run = filter.shown[at], id = runs.id(run);
    const told = runs.happened(run);
    return make("div", { class: "row", role: "row", id: `row-${at}`, "aria-rowindex": at + 1,
      onclick: (event) => event.target.closest("a") || event.ctrlKey || event.metaKey || (location.hash = to(run)) },
      make("span", { class: "id", role: "rowheader" }, make("a", { href: to(run), tabindex: "-1" }, id), runs.canPlay(id) && make("span", { class: "can", role: "img", "aria-label": "can be played back", title: "can be played back" }, "▶")),
      make("span", { class: "score", role: "gridcell" }, Number.isNaN(runs.score[run]) ? "–" : runs.score[run].toFixed(2)),
      runs.slots.map((slot, i) => {
        const outcome = runs.outcome(run, i);
        return make("span", { class: "cell", role: "gridcell" },
          outcome !== NO_OUTCOME && sign(OUTCOMES[outcome], `${slot.property}: ${OUTCOMES[outcome]}`));
      }),
      make("span", { class: "words", role: "gridcell", title: told }, told));
  };
  // Browsers limit the height of elements: of very many rows, a step of the scroll bar passes more than its own height.
  const height = () => Math.min(filter.shown.length * rowHeight, TALLEST);
  const speed = () => {
    const room = height() - list.clientHeight;
    return room > 0 ? (filter.shown.length * rowHeight - list.clientHeight) / room : 1;
  };
  const draw = (more) => {
    body.style.height = `${height()}px`;
    const top = list.scrollTop * speed();
    const first = Math.max(0, Math.floor(top / rowHeight) - more);
    const last = Math.min(filter.shown.length, Math.ceil((top + list.clientHeight) / rowHeight) + more);
    for (const [at, element] of shownRows) {
      if (at < first || at >= last) {
        element.remove();
        shownRows.delete(at);
      }
    }
    for (let at = first; at < last; at++) {
      if (!shownRows.has(at)) {
        shownRows.set(at, row(at));
        body.append(shownRows.get(at));
      }
      shownRows.get(at).style.top = `${at * rowHeight - top + list.scrollTop}px`;
      shownRows.get(at).classList.toggle("active", at === active);
    }
  };
  const drawMore = () => draw(MORE);
  const anew = () => {
    followSort();
    rowHeight = isNarrow() ? TALL_ROW : SHORT_ROW;
    list.classList.toggle("narrow", isNarrow());
    for (const element of shownRows.values()) element.remove();
    shownRows.clear();
    active = -1;
    list.removeAttribute("aria-activedescendant");
    list.hidden = filter.shown.length === 0;
    list.scrollTop = 0;
    draw(0);
    // Rows that are not visible yet are added after the visible ones are drawn.
    requestAnimationFrame(() => setTimeout(drawMore));
  };
  list.addEventListener("scroll", () => requestAnimationFrame(drawMore), { passive: true });
  list.addEventListener("keydown", (event) => {
    const page = Math.max(1, Math.floor(list.clientHeight / rowHeight) - 2);
    const step = { ArrowDown: 1, ArrowUp: -1, PageDown: page, PageUp: -page, Home: -Infinity, End: Infinity }[event.key];
    if (step !== undefined) {
      active = Math.min(filter.shown.length - 1, Math.max(0, active + step));
      const top = active * rowHeight, seen = list.scrollTop * speed();
      if (top < seen) list.scrollTop = top / speed();
      if (top + 3 * rowHeight > seen + list.clientHeight) list.scrollTop = (top + 3 * rowHeight - list.clientHeight) / speed();
      list.setAttribute("aria-activedescendant", `row-${active}`);
      drawMore();
      event.preventDefault();
    } else if (event.key === "Enter" && active >= 0) {
      location.hash = to(filter.shown[active]);
    }
  });
  new ResizeObserver(() => (rowHeight === (isNarrow() ? TALL_ROW : SHORT_ROW) ? drawMore() : anew())).observe(list);
  return [list, anew];
}
