const tabs = [...document.querySelectorAll("nav button")];
const sections = [...document.querySelectorAll("main section")];

function show(name) {
  for (const tab of tabs) tab.setAttribute("aria-selected", String(tab.dataset.section === name));
  for (const section of sections) section.hidden = section.id !== name;
}

for (const tab of tabs) tab.addEventListener("click", () => show(tab.dataset.section));
show(tabs[0].dataset.section);

const motion = JSON.parse(document.getElementById("motion").textContent);
const canvas = document.getElementById("swing");

function project([x, y, z]) {
  const turn = 0.6, tilt = 0.35;
  const across = x * Math.cos(turn) - y * Math.sin(turn);
  const depth = x * Math.sin(turn) + y * Math.cos(turn);
  return [across, -z * Math.cos(tilt) - depth * Math.sin(tilt)];
}

function fitted(points) {
  const flat = points.map(project);
  const low = [0, 1].map((i) => Math.min(...flat.map((p) => p[i])));
  const high = [0, 1].map((i) => Math.max(...flat.map((p) => p[i])));
  const room = 0.76;
  const scale = room * Math.min(canvas.width / (high[0] - low[0] || 1), canvas.height / (high[1] - low[1] || 1));
  return (point) => {
    const p = project(point);
    return [canvas.width / 2 + scale * (p[0] - (low[0] + high[0]) / 2),
      canvas.height / 2 + scale * (p[1] - (low[1] + high[1]) / 2)];
  };
}

function animate() {
  const choice = document.getElementById("mode"), size = document.getElementById("size");
  const pen = canvas.getContext("2d"), place = fitted(motion.rest);
  const play = document.getElementById("play");
  let phase = 0, last = 0, runs = true;

  function line(numbers, points, colour, width) {
    pen.strokeStyle = pen.fillStyle = colour;
    pen.lineWidth = width;
    pen.beginPath();
    numbers.forEach((n, i) => (i ? pen.lineTo(...place(points[n])) : pen.moveTo(...place(points[n]))));
    pen.stroke();
    if (numbers.length === 1) {
      pen.beginPath();
      pen.arc(...place(points[numbers[0]]), 7, 0, 7);
      pen.fill();
    }
  }

  function frame(now) {
    if (runs) phase += (now - last) / 1000 * 2.5;
    last = now;
    const swing = Math.sin(phase) * Number(size.value), moved = motion.modes[Number(choice.value)].moved;
    const points = motion.rest.map((p, i) => p.map((v, k) => v + swing * moved[i][k]));
    pen.clearRect(0, 0, canvas.width, canvas.height);
    for (const numbers of motion.lines) line(numbers, motion.rest, "#d3d8df", 2);
    for (const numbers of motion.lines) line(numbers, points, "#1d4ed8", 3);
    requestAnimationFrame(frame);
  }

  motion.modes.forEach((mode, i) => choice.add(new Option(mode.label, String(i))));
  play.addEventListener("click", () => {
    runs = !runs;
    play.textContent = runs ? "pause" : "play";
  });
  requestAnimationFrame(frame);
}

if (canvas) animate();
