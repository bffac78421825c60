// Addresses: the view, its contents and the filter are in the fragment, so that a link opens the same view again, also from a file.

/** Views whose addresses include the filter. */
const FILTERED = new Set(["runs", "map", "run", "pair"]);

/** The parts of `#/run/ID?t=3.2&outcome=failed`: its way and its query. */
function wayOf(hash) {
  const [path, query = ""] = hash.replace(/^#\/?/, "").split(/\?(.*)/s);
  return { way: path.split("/").map(plain), query: new URLSearchParams(query) };
}

/** Decodes a part of an address that a person may have typed. */
function plain(part) {
  try {
    return decodeURIComponent(part);
  } catch {
    return part;
  }
}

/** The address of a view with its query. */
function addressOf(way, query) {
  const words = String(query ?? "");
  return `#/${way.map(encodeURIComponent).join("/")}${words ? `?${words}` : ""}`;
}

/** The address of the page, which follows its contents. */
class Address {
  constructor(filter) {
    this.filter = filter;
    this.own = {};
    this.way = [""];
  }

  /** Takes over the address that was opened. `own` has the parts of the view itself. */
  opened({ way, query }) {
    this.way = way;
    this.own = Object.fromEntries([...query].filter(([name]) => !QUERY.has(name)));
  }

  /** The address of a view with the present filter. */
  of(...way) {
    return addressOf(way, FILTERED.has(way[0]) ? this.filter.query() : "");
  }

  /** Writes the state of the view into the address. A step back returns to the previous state, unless this one replaces it. */
  note(own, replace = true) {
    // A link was followed, and its view is not drawn yet: its address stays.
    if (addressOf(wayOf(location.hash).way) !== addressOf(this.way)) return;
    Object.assign(this.own, own);
    const query = FILTERED.has(this.way[0]) ? this.filter.query() : new URLSearchParams();
    for (const [name, value] of Object.entries(this.own)) if (value !== "" && value !== null) query.set(name, value);
    const address = addressOf(this.way, query);
    if (address === location.hash) return;
    try {
      history[replace ? "replaceState" : "pushState"](null, "", address);
    } catch {
      // Browsers limit how often an address changes; the view works without it.
    }
  }
}
