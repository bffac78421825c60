// Plots: intervals, distributions, heat maps, trends.

/** A proportion as a bar with its 95 % interval as a whisker. The width of every bar is 100 %. */
function rateBar(found, outcome) {
  if (!found) return make("span", { class: "faint" }, "never decided");
  const part = (share) => `${(share * 100).toFixed(2)}%`;
  return make("span", { class: `rate ${outcome}`, role: "img", "aria-label": interval(found) },
    make("span", { class: "fill", style: { width: part(found.rate) } }),
    make("span", { class: "whisker", style: { left: part(found.low), width: part(found.high - found.low) } }));
}

/** A proportion in a table: its bar, then its numbers. */
function rateCell(found, outcome = "failed") {
  return found ? make("span", { class: "ratecell" }, rateBar(found, outcome), make("span", {}, interval(found))) : make("span", { class: "faint" }, "never decided");
}

/** A histogram of margins: negative values in the colour of failed, positive ones in that of passed. */
function histogram(values, unit, label) {
  const known = values.filter((value) => Number.isFinite(value)).sort((a, b) => a - b);
  if (known.length < 2) return null;
  const at = (share) => known[Math.min(known.length - 1, Math.floor(share * known.length))];
  let [low, high] = [Math.min(at(0.01), 0), Math.max(at(0.99), 0)];
  if (low === high) return null;
  const bins = 48, step = (high - low) / bins, sums = new Array(bins).fill(0);
  const cut = low + Math.round((0 - low) / step) * step;
  low -= cut;
  high -= cut;
  for (const value of known) sums[Math.min(bins - 1, Math.max(0, Math.floor((value - low) / step)))]++;
  const most = Math.max(...sums), width = 560, height = 120, x = (value) => ((value - low) / (high - low)) * width;
  return make("svg", { class: "histogram", viewBox: `0 -6 ${width} ${height + 26}`, role: "img", "aria-label": `${label}: distribution of margins` },
    sums.map((sum, i) => sum > 0 && make("rect", {
      class: low + (i + 0.5) * step < 0 ? "failed" : "passed", x: i * width / bins + 0.5, width: width / bins - 1,
      y: height - Math.max(1.5, sum / most * height), height: Math.max(1.5, sum / most * height),
    }, make("title", { svg: true }, `${counted(sum, "run")}, ${number(low + i * step)} to ${number(low + (i + 1) * step, unit)}`))),
    make("line", { class: "axis", x1: 0, x2: width, y1: height, y2: height }),
    make("line", { class: "zero", x1: x(0), x2: x(0), y1: -6, y2: height + 4 }),
    make("text", { x: 0, y: height + 16 }, number(low)),
    x(0) > 50 && x(0) < width - 50 && make("text", { x: x(0), y: height + 16, "text-anchor": "middle" }, "0"),
    make("text", { x: width, y: height + 16, "text-anchor": "end" }, number(high, unit)));
}

/** A heat map of failures by two parameters. */
function heatMap(map, runs) {
  const cell = ({ runs, failed, failing }) => {
    if (!runs) return make("td", { class: "none" }, "");
    const told = `${failed} of ${runs} failed: ${interval(failing)}`;
    return make("td", { title: told, style: { "--share": failing.rate, "--sure": Math.min(1, 0.35 + runs / 12) } },
      make("span", {}, `${Math.round(failing.rate * 100)}`), make("small", {}, count(runs)));
  };
  const bare = (name) => {
    const { label, unit } = runs.parameter.get(name) ?? { label: (name ?? "").replaceAll("_", " ") };
    return unit && unit !== "1" ? `${label} (${unit})` : label;
  };
  return make("figure", { class: "heat" },
    make("figcaption", {}, `% failed by ${bare(map.by[0])}${map.by[1] ? ` (down) and ${bare(map.by[1])} (across)` : ""}; small: runs`),
    scroller(`Failures by ${bare(map.by[0])}`, make("table", {},
      map.across[0] !== "" && make("thead", {}, make("tr", {}, make("td", {}), map.across.map((name) => make("th", { scope: "col" }, name)))),
      make("tbody", {}, map.down.map((name, i) => make("tr", {}, make("th", { scope: "row" }, name), map.cells[i].map(cell)))))));
}

/** Failure rates from campaign to campaign, with the points where they changed. */
function trendPlot(trend) {
  const { campaigns, changes } = trend;
  const width = 640, height = 150, left = 40;
  const x = (i) => left + 20 + (campaigns.length < 2 ? (width - left) / 2 : i * (width - left - 40) / (campaigns.length - 1));
  const y = (share) => 10 + (1 - share) * (height - 20);
  const every = Math.ceil(campaigns.length / 10);
  const known = campaigns.map((campaign, i) => [campaign, i]).filter(([campaign]) => campaign.failing);
  return make("svg", { class: "trend", viewBox: `0 0 ${width} ${height + 22}`, role: "img", "aria-label": "Share of failures by campaign" },
    [0, 0.5, 1].map((share) => [
      make("line", { class: "axis", x1: left, x2: width, y1: y(share), y2: y(share) }),
      make("text", { x: left - 6, y: y(share) + 4, "text-anchor": "end" }, `${share * 100} %`)]),
    changes.map((change) => {
      const at = campaigns.findIndex((campaign) => campaign.campaign === change.campaign);
      const between = at > 0 ? (x(at) + x(at - 1)) / 2 : x(0);
      return make("line", { class: "change", x1: between, x2: between, y1: 4, y2: height - 6 },
        make("title", { svg: true }, `changed from ${interval(change.before)} to ${interval(change.behind)}, p = ${change.p.toExponential(1)}`));
    }),
    make("polyline", { class: "line", points: known.map(([campaign, i]) => `${x(i)},${y(campaign.failing.rate)}`).join(" ") }),
    known.map(([campaign, i]) => [
      make("line", { class: "span", x1: x(i), x2: x(i), y1: y(campaign.failing.low), y2: y(campaign.failing.high) }),
      make("circle", { class: "dot", cx: x(i), cy: y(campaign.failing.rate), r: 4.5 },
        make("title", { svg: true }, `${campaign.campaign}: ${campaign.failed} of ${campaign.runs} failed, ${interval(campaign.failing)}`)),
      i % every === 0 && make("text", { x: x(i), y: height + 16, "text-anchor": "middle" }, campaign.campaign)]));
}
