// Labels of things in the 3D view: text beside the picture, so that it is as sharp as the page's.

/** Space that a label leaves to the next one. Unit: pixels. */
const LABEL_GAP = 2;
/** How often a label moves up before it is hidden. */
const LABEL_TRIES = 4;

class Labels {
  constructor() {
    this.element = make("div", { class: "labels", "aria-hidden": "true" });
    this.items = [];
  }

  /** Adds a label. `at` returns its place at a moment, or `null`; labels added first are more important. */
  add(kind, words, at) {
    const element = make("span", { class: `label ${kind}` }, words);
    this.items.push({ element, at });
    this.element.append(element);
    return element;
  }

  /** Places all labels for a moment: above each other where they would overlap, and hidden where there is no room. */
  place(three, camera, secs, width, height) {
    const taken = [];
    for (const { element, at } of this.items) {
      const point = at(secs), seen = point && new three.Vector3(...point).project(camera);
      const inside = seen && seen.z < 1 && Math.abs(seen.x) < 0.98 && Math.abs(seen.y) < 0.98;
      element.hidden = !inside;
      if (!inside) continue;
      const [wide, tall] = [element.offsetWidth, element.offsetHeight];
      const left = Math.min(width - wide - 4, Math.max(4, (seen.x + 1) / 2 * width - wide / 2));
      let top = Math.max(4, (1 - seen.y) / 2 * height - tall), tries = 0;
      const clash = () => taken.find((other) => left < other.right && left + wide > other.left && top < other.bottom && top + tall > other.top);
      for (let other = clash(); other && tries < LABEL_TRIES; other = clash(), tries++) top = other.top - tall - LABEL_GAP;
      element.hidden = top < 0 || Boolean(clash());
      if (element.hidden) continue;
      taken.push({ left, right: left + wide, top, bottom: top + tall });
      element.style.transform = `translate(${Math.round(left)}px, ${Math.round(top)}px)`;
    }
  }
}
