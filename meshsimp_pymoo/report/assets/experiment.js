// The page of an experiment: its fronts, drawn when they come into sight.

const { charts } = JSON.parse(document.getElementById("data").textContent);
const boxes = { x: document.getElementById("log-x"), y: document.getElementById("log-y") };
const drawn = [];

function draw(target) {
  if (target.dataset.drawn) return;
  watcher.unobserve(target);
  const { name, label, series } = charts[target.id];
  const labels = { x: "triangles", y: label };
  drawn.push(new FrontChart(target, { name, series, labels, log: { x: boxes.x.checked, y: boxes.y.checked } }));
  target.dataset.drawn = "yes";
}

const watcher = new IntersectionObserver(
  (entries) => entries.filter((entry) => entry.isIntersecting).forEach((entry) => draw(entry.target)),
  { rootMargin: "400px" },
);
const places = Object.keys(charts).map((id) => document.getElementById(id));
places.forEach((place) => watcher.observe(place));
addEventListener("beforeprint", () => places.forEach(draw)); // on paper all are in sight
for (const axis of ["x", "y"]) {
  boxes[axis].addEventListener("change", () => drawn.forEach((chart) => chart.setLog(axis, boxes[axis].checked)));
}
document.documentElement.dataset.ready = "yes";
