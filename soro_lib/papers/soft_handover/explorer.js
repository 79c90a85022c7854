// A camera's picture in which things are grabbed and dragged; arrow keys move what was grabbed last.
// `drag` tells Python: [pixel x, pixel y, number of the gesture, 1 while the button is down].

function render({ model, el }) {
  const image = document.createElement("img");
  image.style.cssText = "width:100%;display:block;border-radius:6px;cursor:grab;touch-action:none;user-select:none";
  image.draggable = false;
  image.tabIndex = 0;
  el.appendChild(image);
  let address = null;
  let gesture = 0;
  let last = [0, 0];
  let waiting = null;

  function show() {
    const picture = model.get("picture");
    if (!picture || !picture.byteLength) return;
    const previous = address;
    address = URL.createObjectURL(new Blob([picture], { type: "image/jpeg" }));
    image.src = address;
    if (previous) setTimeout(() => URL.revokeObjectURL(previous), 500);
  }

  function send(down) {
    model.set("drag", [...last, gesture, down]);
    model.save_changes();
  }

  // At most one message per 60 ms: Python draws a picture for each.
  function follow(event) {
    const box = image.getBoundingClientRect();
    last = [
      ((event.clientX - box.left) / box.width) * image.naturalWidth,
      ((event.clientY - box.top) / box.height) * image.naturalHeight,
    ];
    waiting ??= setTimeout(() => {
      waiting = null;
      send(1);
    }, 60);
  }

  image.addEventListener("pointerdown", (event) => {
    event.preventDefault();
    image.focus();
    image.setPointerCapture(event.pointerId);
    image.style.cursor = "grabbing";
    gesture += 1;
    follow(event);
  });
  image.addEventListener("pointermove", (event) => event.buttons && follow(event));
  image.addEventListener("pointerup", (event) => {
    follow(event);
    clearTimeout(waiting);
    waiting = null;
    image.style.cursor = "grab";
    send(0);
  });
  image.addEventListener("keydown", (event) => {
    const steps = { ArrowLeft: [-15, 0], ArrowRight: [15, 0], ArrowUp: [0, -15], ArrowDown: [0, 15] };
    const step = steps[event.key];
    if (!step || !gesture) return;
    event.preventDefault();
    last = [last[0] + step[0], last[1] + step[1]];
    send(1);
  });
  const name = () => image.setAttribute("alt", model.get("label"));
  model.on("change:picture", show);
  model.on("change:label", name);
  show();
  name();
}

export default { render };
