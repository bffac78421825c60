// Formats numbers, proportions and names.

const THIN = "\u2009";

/** A number with four significant digits. */
function number(value, unit = "") {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  const digits = Number.isInteger(value) ? String(value) : String(Number(value.toPrecision(4)));
  const shown = digits.replace("-", "\u2212");
  return unit && unit !== "1" ? `${shown}${THIN}${unit}` : shown;
}

/** A count with a thousands separator. */
function count(value) {
  return String(value).replace(/\B(?=(\d{3})+$)/g, THIN);
}

/** `1 run`, `2 runs` */
function counted(value, noun) {
  return `${count(value)} ${noun}${value === 1 ? "" : "s"}`;
}

/** A share, as the program prints it: halves are rounded to even numbers. */
function percent(share) {
  const value = share * 100;
  return `${value > 0 && value < 9.95 ? value.toFixed(1) : whole(value)}${THIN}%`;
}

/** The nearest whole number, of two the even one. */
function whole(value) {
  const near = Math.round(value);
  return Math.abs(value - Math.trunc(value)) === 0.5 && near % 2 !== 0 ? near - 1 : near;
}

/** `71 % [58–82]` */
function interval(found) {
  if (!found) return "–";
  return `${percent(found.rate)} [${whole(found.low * 100)}–${whole(found.high * 100)}]`;
}

/** The 95 % Wilson score interval (1927), as everywhere in actcheck. */
function wilson(successes, trials) {
  if (!trials) return null;
  const z = 1.959963984540054;
  const rate = successes / trials, denominator = 1 + z * z / trials;
  const centre = (rate + z * z / (2 * trials)) / denominator;
  const half = z / denominator * Math.sqrt(rate * (1 - rate) / trials + z * z / (4 * trials * trials));
  return { rate, low: rate === 0 ? 0 : Math.max(0, centre - half), high: rate === 1 ? 1 : Math.min(1, centre + half) };
}

/** A name with line break opportunities, such as between `Object`, `In` and `Gripper`. They are elements, so that a copy is plain. */
function breakable(name) {
  return name.split(/(?<=[a-z0-9])(?=[A-Z])|(?<=_)/).flatMap((part, i) => i ? [make("wbr"), part] : [part]);
}

function moment(text) {
  return String(text ?? "").replace("T", " ").replace(/:\d\d(\.\d+)?Z$/, "");
}

/** Quotes a word for a shell. */
function quoted(word) {
  return /^[\w./:@%+=,-]+$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`;
}

/** A command with a button that copies it. */
function command(words) {
  const button = make("button", { type: "button", class: "copy", "aria-label": `Copy: ${words}`, onclick: async () => {
    try {
      await navigator.clipboard.writeText(words);
      button.textContent = "copied";
    } catch {
      // Without access to the clipboard, the words are selected, ready to be copied.
      getSelection().selectAllChildren(code);
      button.textContent = "selected";
    }
    setTimeout(() => { button.textContent = "copy"; }, 2000);
  } }, "copy");
  const code = make("code", {}, words);
  return make("div", { class: "command" }, code, button);
}
