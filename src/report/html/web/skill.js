// The side of a user's program, below its replay and in step with it: its output, commands and questions.

/** Entries that are shown at once before the list is asked for more. */
const MOST_ENTRIES = 400;

/** The panel of a run's program; `null` if no program took part. `seek` moves the replay. */
function skillPanel(replay, seek) {
  const log = replay.skill;
  if (!log) return null;
  const rows = log.entries.slice(0, MOST_ENTRIES).map((entry) => [entry, entryRow(entry, seek)]);
  const printed = log.entries.filter((entry) => "printed" in entry).length, asked = log.entries.filter((entry) => "asked" in entry).length;
  const commands = log.entries.reduce((sum, entry) => sum + (entry.commands ?? 0), 0);
  const list = make("ol", { class: "skilllog", tabindex: "0", "aria-label": "The program's output, commands and questions" }, rows.map(([, row]) => row));
  const only = make("input", { type: "checkbox", onchange: () => list.classList.toggle("onlyprinted", only.checked) });
  const left = [[log.lines_left_out, "printed line"], [log.others_left_out, "command or question"], [log.entries.length - rows.length, "entry of the log"]]
    .filter(([count]) => count > 0).map(([count, noun]) => `${count}${THIN}× ${noun}`);
  let now = null;
  const mark = (secs) => {
    // The last entry that began, so that equal moments show the latest line.
    const at = rows.findLastIndex(([entry]) => entry.secs <= secs + 1e-3), row = rows[at]?.[1] ?? null;
    if (row === now) return;
    now?.removeAttribute("aria-current");
    now = row;
    if (!row) return;
    row.setAttribute("aria-current", "true");
    list.scrollTop = Math.max(0, row.offsetTop + row.offsetHeight / 2 - list.clientHeight / 2);
  };
  const element = make("section", { class: "skill" },
    make("h2", {}, "The program's side"),
    make("div", { class: "skillhead" }, make("span", { class: "faint" }, `${counted(printed, "line")} printed, ${counted(commands, "command")}, ${counted(asked, "question")}`),
      make("label", { class: "check" }, only, " only its output")),
    filmStrip(replay, seek), list, left.length > 0 && make("p", { class: "faint" }, `Not kept, in the middle: ${left.join(", ")}`));
  return { element, mark };
}

function entryRow(entry, seek) {
  const kind = "printed" in entry ? "printed" : "asked" in entry ? "asked" : "commanded";
  return make("li", { class: kind },
    make("button", { type: "button", class: "flat", onclick: () => seek(entry.secs) }, `${entry.secs.toFixed(2)}${THIN}s`),
    kind === "printed" ? make("code", {}, entry.printed) : make("span", {}, kind === "asked" ? question(entry) : commanded(entry)));
}

function question({ asked, of, count, bytes, objects }) {
  const nouns = { cloud: "points", objects: count === 1 ? "object" : "objects" };
  const at = objects.map(({ id, position_m }) => `${id} at (${position_m.map((along) => along.toFixed(3)).join(", ")}) m`);
  return `asks for ${asked}${of ? ` of ${of}` : ""} → ${count} ${nouns[asked] ?? "pixels"}${bytes ? `, ${Math.ceil(bytes / 1000)} kB` : ""}${at.length ? `: ${at.join(", ")}` : ""}`;
}

function commanded({ commands, secs, until, targets }) {
  const words = targets.map(({ kind, joint, value }) => {
    const shown = number(value);
    switch (kind) {
      case "position": return `${joint} ${shown}`;
      case "velocity": return `${joint} ${shown}/s`;
      case "effort": return `effort of ${joint} ${shown}`;
      case "opening": return `opening ${inUnit(value, "m")}`;
      case "force": return `force ${shown}${THIN}N`;
      default: return `${kind} ${shown}`;
    }
  });
  const deed = words.length ? `${commands === 1 ? "commands" : `${commands} commands, at last`} ${words.join(", ")}`
    : commands === 1 ? "waits" : `${commands} commands without new targets`;
  return `${deed}, ${(until - secs).toFixed(2)}${THIN}s`;
}
