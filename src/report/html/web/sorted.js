// Tables that are sorted by a click on the head of a column: up, down, then as they were.

/** Makes a table sortable if it has a head and more than one row. Maps of two conditions, whose first head is empty, are not. */
function sortable(table) {
  const heads = [...table.tHead?.rows[0]?.cells ?? []], body = table.tBodies[0], first = [...body?.rows ?? []];
  if (first.length < 2 || !heads.length || heads.some((head) => head.tagName !== "TH" || head.querySelector("a, button"))) return;
  heads.forEach((head, column) => {
    const button = make("button", { type: "button", class: "flat sorts" });
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const order = { ascending: "descending", descending: "none" }[head.ariaSort] ?? "ascending";
      for (const other of heads) other.removeAttribute("aria-sort");
      if (order !== "none") head.setAttribute("aria-sort", order);
      body.append(...(order === "none" ? first : ordered(first, column, order === "descending")));
    });
  });
}

/** Rows by a column: by number if all its cells have one, else by text. Cells without a value are last. */
function ordered(rows, column, isDescending) {
  const texts = rows.map((row) => row.cells[column].textContent.trim()), numbers = texts.map(leadingNumber);
  const isNumeric = rows[0].cells[column].tagName === "TD" && texts.every((text, i) => isMissing(text) || !Number.isNaN(numbers[i]));
  const known = rows.map((row, i) => ({ row, text: texts[i], number: numbers[i] }));
  const compare = isNumeric ? (a, b) => a.number - b.number : (a, b) => a.text.localeCompare(b.text, undefined, { numeric: true });
  const [missing, present] = [known.filter(({ text }) => isMissing(text)), known.filter(({ text }) => !isMissing(text))];
  return [...present.sort((a, b) => isDescending ? compare(b, a) : compare(a, b)), ...missing].map(({ row }) => row);
}

function isMissing(text) {
  return text === "" || text === "–";
}

/** The number with which a text begins, as `words.js` writes numbers; `NaN` if it begins with a letter or a date. */
function leadingNumber(text) {
  if (/^\d{4}-\d\d-\d\d/.test(text)) return NaN;
  const found = /^[−-]?[\d\u2009]*\.?\d+(e[+-]?\d+)?/.exec(text);
  return found ? Number(found[0].replace("−", "-").replaceAll("\u2009", "")) : NaN;
}
