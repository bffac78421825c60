// Replays from the page or from the server, and a report that a server keeps up to date.

/** Interval at which a served report asks for changes. Unit: milliseconds. */
const ASK_EVERY = 2000;
/** Number of replays from the server that are kept. */
const MOST_FETCHED = 6;
/** Views that are not drawn anew when a run ends: someone watches. */
const WATCHED = new Set(["run", "pair"]);

const fetchedReplays = new Map();

/** The replay of a run with its shapes: from the page, or from the server that serves it. */
async function replayOf({ replayed, summary }, id) {
  const number = replayed.get(id);
  if (number !== undefined) {
    const [replay, forms] = await Promise.all([unpack(`replay-${number}`), formsOf()]);
    return { replay, forms };
  }
  if (!summary.served) throw new Error("it is not in this file");
  if (!fetchedReplays.has(id)) {
    if (fetchedReplays.size >= MOST_FETCHED) fetchedReplays.delete(fetchedReplays.keys().next().value);
    fetchedReplays.set(id, fetchedReplay(id).catch((error) => { fetchedReplays.delete(id); throw error; }));
  }
  const { replay, forms } = await fetchedReplays.get(id);
  return { replay: unpacked(replay.slice(0)), forms };
}

async function fetchedReplay(id) {
  const answer = await fetch(`/replay?run=${encodeURIComponent(id)}`);
  if (!answer.ok) throw new Error((await answer.text()).trim());
  const { forms, replay } = await answer.json();
  return { replay: await inflatedOf(replay), forms: JSON.parse(textOf(await inflatedOf(forms))) };
}

/** Asks the server for changes, and draws the view anew when there are some: `redraw`. */
function keepLive(report, redraw) {
  let state = "";
  const told = document.querySelector(".live");
  const tell = (word) => { told.textContent = ` · ${word}`; };
  const asked = async () => {
    const answer = await fetch(`/data?state=${encodeURIComponent(state)}`);
    return { isRead: answer.ok, data: answer.status === 200 ? await answer.json() : null };
  };
  const ask = async () => {
    if (!document.hidden) {
      const { isRead, data } = await asked().catch(() => ({ isRead: false, data: null }));
      if (data && (state || data.runs !== document.getElementById("data-runs").textContent)) await take(report, data, redraw);
      state = data?.state ?? state;
      tell(isRead ? progress(report.summary) : "the server does not answer, or can't read the history at present");
    }
    setTimeout(ask, ASK_EVERY);
  };
  tell(progress(report.summary));
  setTimeout(ask, ASK_EVERY);
}

/** The campaigns that are still running, with their numbers of runs. */
function progress({ campaigns }) {
  const running = campaigns.filter((row) => !row.ended);
  return running.length ? `running: ${running.map((row) => `${row.id}, ${count(row.runs)} of ${counted(row.planned, "run")}`).join("; ")}` : "up to date";
}

/** Replaces the data of the report. The filter stays, and so does the place in the page. */
async function take(report, { summary, runs }, redraw) {
  const [newSummary, columns] = await Promise.all([summary, runs].map(async (letters) => unpacked(await inflatedOf(letters))));
  const { filter } = report, query = filter.query(), place = [scrollY, document.querySelector(".list")?.scrollTop];
  report.summary = newSummary;
  report.runs = filter.runs = new Runs(columns, newSummary);
  filter.sets = patternSets(newSummary.findings);
  // The view that is shown has the old runs: it is drawn anew instead of following the filter.
  Object.assign(filter, filter.ofQuery(query));
  filter.shown = filter.chosen();
  gatherLetters(report.runs);
  if (WATCHED.has(wayOf(location.hash).way[0])) return;
  redraw();
  scrollTo(0, place[0]);
  const list = document.querySelector(".list");
  if (list && place[1]) list.scrollTop = place[1];
}
