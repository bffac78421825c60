// The camera's images that a run's program asked for, below its log.

/** The strip of images; `null` if the program asked for none. `seek` moves the replay. */
function filmStrip(replay, seek) {
  if (!replay.film?.length) return null;
  const image = ([secs, src]) => make("button", { type: "button", class: "flat", onclick: () => seek(secs) },
    make("img", { src, alt: `The camera's image at ${secs.toFixed(2)} s`, width: 160 }), make("span", { class: "faint" }, `${secs.toFixed(2)}${THIN}s`));
  return make("div", { class: "film", role: "group", tabindex: "0", "aria-label": "Images that the program asked for" }, replay.film.map(image));
}
