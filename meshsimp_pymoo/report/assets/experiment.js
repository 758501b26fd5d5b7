// The page of an experiment: its fronts, drawn when they come into sight.

const { charts } = JSON.parse(document.getElementById("data").textContent);
const boxes = { x: document.getElementById("log-x"), y: document.getElementById("log-y") };
const drawn = [];

const watcher = new IntersectionObserver(
  (entries) => {
    for (const { isIntersecting, target } of entries) {
      if (!isIntersecting) continue;
      watcher.unobserve(target);
      const { name, series } = charts[target.id];
      const labels = { x: "triangles", y: "error [file units]" };
      drawn.push(new FrontChart(target, { name, series, labels, log: { x: boxes.x.checked, y: boxes.y.checked } }));
      target.dataset.drawn = "yes";
    }
  },
  { rootMargin: "400px" },
);
for (const id of Object.keys(charts)) watcher.observe(document.getElementById(id));
for (const axis of ["x", "y"]) {
  boxes[axis].addEventListener("change", () => drawn.forEach((chart) => chart.setLog(axis, boxes[axis].checked)));
}
document.documentElement.dataset.ready = "yes";
