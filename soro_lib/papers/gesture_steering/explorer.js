// A square pad with a dot that is dragged, or moved with the arrow keys; x and y run from -1 to 1, y upwards.

const SIZE = 190;

function render({ model, el }) {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 2 * SIZE;
  canvas.style.cssText = `width:${SIZE}px;height:${SIZE}px;touch-action:none;cursor:crosshair;border-radius:6px`;
  canvas.tabIndex = 0;
  canvas.setAttribute("role", "slider");
  el.appendChild(canvas);
  const context = canvas.getContext("2d");

  const draw = () => {
    const [x, y] = [model.get("x"), model.get("y")];
    canvas.setAttribute("aria-label", model.get("label"));
    canvas.setAttribute("aria-valuetext", `${x.toFixed(2)}, ${y.toFixed(2)}`);
    const ink = getComputedStyle(el).color;
    context.clearRect(0, 0, canvas.width, canvas.height);
    context.strokeStyle = ink;
    context.fillStyle = ink;
    context.globalAlpha = 0.25;
    for (let i = 0; i <= 6; i++) {
      const at = 2 + (i * (canvas.width - 4)) / 6;
      context.lineWidth = i === 3 ? 3 : 1;
      context.strokeRect(at, 2, 0.01, canvas.height - 4);
      context.strokeRect(2, at, canvas.width - 4, 0.01);
    }
    context.globalAlpha = 0.8;
    context.font = "20px sans-serif";
    context.fillText(model.get("label"), 10, 26);
    context.globalAlpha = 1;
    context.fillStyle = "#D55E00";
    context.beginPath();
    context.arc(((x + 1) / 2) * canvas.width, ((1 - y) / 2) * canvas.height, 16, 0, 2 * Math.PI);
    context.fill();
  };

  const clamp = (value) => Math.max(-1, Math.min(1, value));
  const move = (x, y) => {
    model.set("x", clamp(x));
    model.set("y", clamp(y));
    model.save_changes();
    draw();
  };
  const follow = (event) => {
    const box = canvas.getBoundingClientRect();
    move(((event.clientX - box.left) / box.width) * 2 - 1, 1 - ((event.clientY - box.top) / box.height) * 2);
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    follow(event);
  });
  canvas.addEventListener("pointermove", (event) => event.buttons && follow(event));
  canvas.addEventListener("keydown", (event) => {
    const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const step = steps[event.key];
    if (!step) return;
    event.preventDefault();
    move(model.get("x") + 0.05 * step[0], model.get("y") + 0.05 * step[1]);
  });
  model.on("change:x change:y", draw);
  draw();
}

export default { render };
