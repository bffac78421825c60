// Creates DOM elements. Strings are always inserted as text: none of these scripts parses markup.

const SVG_NAMES = new Set(["svg", "g", "path", "rect", "line", "circle", "text", "polyline", "polygon", "title", "defs",
  "pattern", "clipPath"]);

/** Creates an element: `make("button", { class: "flat", onclick: go }, "words", other)`. Empty children are skipped. */
function make(name, attributes = {}, ...children) {
  const element = name !== "title" && SVG_NAMES.has(name) || attributes.svg
    ? document.createElementNS("http://www.w3.org/2000/svg", name)
    : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false || key === "svg") continue;
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (key === "style") for (const [name, to] of Object.entries(value)) element.style.setProperty(name, to);
    else element.setAttribute(key, value === true ? "" : String(value));
  }
  put(element, ...children);
  return element;
}

/** Appends children: elements, strings, or lists of them. */
function put(element, ...children) {
  for (const child of children.flat(Infinity)) {
    if (child === undefined || child === null || child === false || child === "") continue;
    element.append(child instanceof Node ? child : String(child));
  }
}

/** Replaces the children of an element. */
function fill(element, ...children) {
  element.replaceChildren();
  put(element, ...children);
  return element;
}

/** A box that scrolls sideways, also with the keyboard. A table in it can be sorted by each column. */
function scroller(label, ...children) {
  const box = make("div", { class: "scroll", tabindex: "0", role: "group", "aria-label": label }, children);
  for (const table of box.querySelectorAll("table")) sortable(table);
  return box;
}

/** Local name of an IRI: the part after the last `#` or `/`. */
function local(iri) {
  return String(iri ?? "").replace(/^.*[#/]/, "");
}
