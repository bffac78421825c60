// Labels of things in the 3D view: text beside the picture, so that it is as sharp as the page's.

/** Space that a label leaves to the next one. Unit: pixels. */
const LABEL_GAP = 2;
/** How often a label moves up before it is hidden. */
const LABEL_TRIES = 8;
/** Half the width of the star at a contact, which its label leaves free. Unit: pixels. */
const STAR_PX = 20;
/** Distances from the star at which its label is tried. Unit: pixels. */
const BESIDE_PX = [4, 30, 70, 120, 180, 260];
/** Directions in which it is tried: right, left, up, down, then between them. */
const BESIDE = [[1, 0], [-1, 0], [0, -1], [0, 1], [1, -1], [-1, -1], [1, 1], [-1, 1]];

class Labels {
  constructor() {
    this.element = make("div", { class: "labels", "aria-hidden": "true" });
    this.items = [];
    this.things = [];
    /** How many labels of the last picture have no room. */
    this.crowded = 0;
    this.counted = () => {};
  }

  /** Keeps labels off a thing. `corners` returns the corners of the box around it at a moment. */
  spare(corners) {
    this.things.push(corners);
  }

  /**
   * Adds a label. `at` returns its place at a moment, or `null`; labels added first are more important. `own` returns the
   * corners of the box around its thing, which it does not cover. `isMark`: it belongs to a star at its place.
   */
  add(kind, words, at, own = () => null, isMark = false) {
    const element = make("span", { class: `label ${kind}` }, words);
    this.items.push({ element, at, own, isMark });
    this.element.append(element);
    return element;
  }

  /** Places all labels for a moment: where they cover neither a thing nor each other, and hidden where there is no room. */
  place(three, camera, secs, width, height) {
    const project = (point) => {
      const seen = new three.Vector3(...point).project(camera);
      return { x: (seen.x + 1) / 2 * width, y: (1 - seen.y) / 2 * height, isInside: seen.z < 1 && Math.abs(seen.x) < 0.98 && Math.abs(seen.y) < 0.98, isAhead: seen.z < 1 };
    };
    const around = (corners) => {
      const seen = corners.map(project).filter(({ isAhead }) => isAhead), [xs, ys] = [seen.map(({ x }) => x), seen.map(({ y }) => y)];
      return seen.length ? [{ left: Math.min(...xs), right: Math.max(...xs), top: Math.min(...ys) - LABEL_GAP, bottom: Math.max(...ys) }] : [];
    };
    const taken = [], things = this.things.flatMap((corners) => around(corners(secs)));
    const clash = (box, others) => others.find((other) => box.left < other.right && box.right > other.left && box.top < other.bottom && box.bottom > other.top);
    this.crowded = 0;
    for (const { element, at, own, isMark } of this.items) {
      const point = at(secs), seen = point && project(point);
      element.hidden = !seen?.isInside;
      if (element.hidden) continue;
      const [wide, tall] = [element.offsetWidth, element.offsetHeight];
      const [thing] = around(own(secs) ?? []), isFurniture = element.classList.contains("furniture");
      const box = isMark ? besideStar(seen, wide, tall, [...taken, ...things], thing ? [thing] : [], { width, height, clash })
        : (thing && around4(thing, wide, tall, { width, height }).find((one) => !clash(one, [...taken, ...things])))
          ?? above(seen, wide, tall, isFurniture ? [...taken, ...things] : taken, { width, clash });
      element.hidden = !box;
      if (!box) {
        this.crowded++;
        continue;
      }
      taken.push(box);
      element.style.transform = `translate(${Math.round(box.left)}px, ${Math.round(box.top)}px)`;
    }
    this.counted();
  }
}

/** Boxes of a label around its thing: above, right, left and below it. */
function around4(thing, wide, tall, { width, height }) {
  const middle = (thing.left + thing.right - wide) / 2, upper = thing.top + LABEL_GAP;
  return [[middle, thing.top - tall - LABEL_GAP], [thing.right + LABEL_GAP, upper], [thing.left - wide - LABEL_GAP, upper], [middle, thing.bottom + LABEL_GAP]]
    .map(([left, top]) => ({ left, right: left + wide, top, bottom: top + tall }))
    .filter(({ left, right, top, bottom }) => left >= 4 && top >= 4 && right <= width - 4 && bottom <= height - 4);
}

/** The box of a label above its place, moved up off all others; `null` if there is no room. */
function above(seen, wide, tall, others, { width, clash }) {
  const left = Math.min(width - wide - 4, Math.max(4, seen.x - wide / 2)), box = (top) => ({ left, right: left + wide, top, bottom: top + tall });
  let top = Math.max(4, seen.y - tall);
  for (let tries = 0, other; tries <= LABEL_TRIES; tries++, top = other.top - tall - LABEL_GAP) {
    other = clash(box(top), others);
    if (!other) return top < 0 ? null : box(top);
  }
  return null;
}

/** The box of a label beside the star at its place, off all others and outside its own thing; if that fills the picture, only off all others. */
function besideStar(seen, wide, tall, others, own, { width, height, clash }) {
  const star = { left: seen.x - STAR_PX, right: seen.x + STAR_PX, top: seen.y - STAR_PX, bottom: seen.y + STAR_PX };
  const tried = BESIDE_PX.flatMap((away) => BESIDE.map(([x, y]) => {
    const left = seen.x + x * (STAR_PX + away) - (x < 0 ? wide : x > 0 ? 0 : wide / 2), top = seen.y + y * (STAR_PX + away) - (y < 0 ? tall : y > 0 ? 0 : tall / 2);
    return { left, right: left + wide, top, bottom: top + tall };
  })).filter(({ left, right, top, bottom }) => left >= 4 && top >= 4 && right <= width - 4 && bottom <= height - 4);
  const corner = { left: 4, right: 4 + wide, top: 4, bottom: 4 + tall };
  return [...tried, corner].find((box) => !clash(box, [...others, star, ...own])) ?? tried.find((box) => !clash(box, [...others, star])) ?? corner;
}
