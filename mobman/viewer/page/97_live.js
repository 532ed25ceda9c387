// Following a run while it goes: its frames are asked for from the server that the page came from.
const PAUSE = 60; // ms between two questions

async function follow(app) {
  while (app.live) {
    let news = null;
    try {
      const answer = await fetch(`frames?after=${app.runs[0].motion.end}`, { cache: "no-store" });
      if (answer.ok) news = await answer.json();
    } catch (error) {
      // the process is gone; what it sent remains
    }
    if (news === null) news = { ended: true, info: { ...app.runs[0].info, status: "interrupted", message: "" } };
    take(app, news);
    if (app.live) await new Promise((resolve) => setTimeout(resolve, PAUSE));
  }
}

// More frames; or, when it has ended, all of the run.
function take(app, news) {
  const run = app.runs[0];
  const { scene } = app;
  if (news.motion) {
    const motion = new Motion(news.motion);
    if (news.ended) run.motion = motion;
    else run.motion.extend(motion);
  }
  if (news.error_decades) scene.error_decades = news.error_decades;
  if (news.info) run.description.info = news.info;
  if (news.motion) run.drawMotion(scene.error_decades);
  if (!news.ended) return;
  app.live = false;
  scene.duration = run.motion.end;
  app.overlay.addLegend();
  app.panel.setDuration(scene.duration);
  app.setTime(scene.duration);
}
