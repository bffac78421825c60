// The six outcomes: never merged, and distinguished by symbol as well as by colour.

const OUTCOMES = ["passed", "failed", "inapplicable", "broken", "timeout", "untested"];
const SIGNS = { passed: "✓", failed: "✕", inapplicable: "–", broken: "!", timeout: "◷", untested: "·" };
const MEANING = {
  passed: "the property holds",
  failed: "the property does not hold, and the robot caused it",
  inapplicable: "the property does not apply to this action",
  broken: "simulation, transport or the tool was at fault",
  timeout: "a budget was spent",
  untested: "the action was never reached",
};
const [PASSED, FAILED, , BROKEN, TIMEOUT] = [0, 1, 2, 3, 4];
const NO_OUTCOME = 255;

/** A small tile with the symbol of an outcome. */
function sign(outcome, title = outcome) {
  return make("span", { class: `sign ${outcome}`, title, role: "img", "aria-label": title }, SIGNS[outcome]);
}

/** A label in the colour of an outcome. */
function badge(outcome, words = outcome) {
  return make("span", { class: `badge ${outcome}` }, make("span", { "aria-hidden": "true" }, SIGNS[outcome] ?? "✓"), ` ${words}`);
}

/** The shares of the outcomes, as a stacked bar. */
function shares(counts, label) {
  const total = OUTCOMES.reduce((sum, word) => sum + counts[word], 0);
  const told = OUTCOMES.filter((word) => counts[word]).map((word) => `${word} ${counts[word]}`).join(", ");
  const parts = OUTCOMES.filter((word) => counts[word]).map((word) =>
    make("span", { class: `part ${word}`, style: { "flex-grow": counts[word] / total }, title: `${word}: ${counts[word]}` }));
  return make("div", { class: "shares", role: "img", "aria-label": `${label}: ${told || "nothing"}` }, parts);
}

/** The colour of an outcome in the current theme. */
function colourOf(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}
