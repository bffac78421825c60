// Labels of things in the 3D view: text beside the picture, so that it is as sharp as the page's.

/** Space that a label leaves to the next one. Unit: pixels. */
const LABEL_GAP = 2;
/** Least half width of a thing that labels of furniture spare. Unit: pixels. */
const THING_PX = 14;
/** How often a label moves up before it is hidden. */
const LABEL_TRIES = 4;

class Labels {
  constructor() {
    this.element = make("div", { class: "labels", "aria-hidden": "true" });
    this.items = [];
    this.things = [];
  }

  /** Keeps the labels of furniture off a thing. `ends` returns its lower and its upper end at a moment. */
  spare(ends) {
    this.things.push(ends);
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
    const things = this.things.map((ends) => {
      const [foot, top] = ends(secs).map((point) => {
        const seen = new three.Vector3(...point).project(camera);
        return [(seen.x + 1) / 2 * width, (1 - seen.y) / 2 * height];
      });
      const beside = Math.max(THING_PX, Math.abs(foot[1] - top[1]) / 3);
      return { left: Math.min(foot[0], top[0]) - beside, right: Math.max(foot[0], top[0]) + beside, top: Math.min(foot[1], top[1]) - LABEL_GAP, bottom: Math.max(foot[1], top[1]) };
    });
    for (const { element, at } of this.items) {
      const point = at(secs), seen = point && new three.Vector3(...point).project(camera);
      const inside = seen && seen.z < 1 && Math.abs(seen.x) < 0.98 && Math.abs(seen.y) < 0.98;
      element.hidden = !inside;
      if (!inside) continue;
      const [wide, tall] = [element.offsetWidth, element.offsetHeight];
      const left = Math.min(width - wide - 4, Math.max(4, (seen.x + 1) / 2 * width - wide / 2));
      let top = Math.max(4, (1 - seen.y) / 2 * height - tall), tries = 0;
      const avoided = element.classList.contains("furniture") ? [...taken, ...things] : taken;
      const clash = () => avoided.find((other) => left < other.right && left + wide > other.left && top < other.bottom && top + tall > other.top);
      for (let other = clash(); other && tries < LABEL_TRIES; other = clash(), tries++) top = other.top - tall - LABEL_GAP;
      element.hidden = top < 0 || Boolean(clash());
      if (element.hidden) continue;
      taken.push({ left, right: left + wide, top, bottom: top + tall });
      element.style.transform = `translate(${Math.round(left)}px, ${Math.round(top)}px)`;
    }
  }
}
