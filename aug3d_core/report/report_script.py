"""The report's few lines of script. Without them nothing is lost but comfort.

A click on a picture shows it as large as the window, another one at its own size. A click on a camera of the map shows a
group that it is in, the next click its next group, and after the last one all cameras again. A slider over two pictures
moves the line between them; its button shows both as large as the window.
"""

SCRIPT = """
const dialog = document.querySelector('dialog');
const shut = document.createElement('button');
shut.textContent = '\u00d7';
shut.ariaLabel = 'Close';
shut.onclick = () => dialog.close();
const show = (content) => { dialog.replaceChildren(content, shut); dialog.showModal(); };
for (const image of document.querySelectorAll('figure > img')) {
  image.tabIndex = 0;
  image.setAttribute('role', 'button');
  const enlarge = () => {
    const copy = image.cloneNode();
    copy.onclick = () => copy.classList.toggle('full');
    show(copy);
  };
  image.onclick = enlarge;
  image.onkeydown = (event) => { if (event.key === 'Enter') enlarge(); };
}
dialog.onclick = (event) => { if (event.target === dialog) dialog.close(); };

const slides = (slider) => {
  const handle = slider.querySelector('input');
  handle.oninput = () => slider.style.setProperty('--at', `${handle.value}%`);
  return slider;
};
for (const slider of document.querySelectorAll('.slider')) {
  const larger = document.createElement('button');
  larger.textContent = '\u2922';
  larger.ariaLabel = 'Enlarge';
  larger.onclick = () => {
    const copy = slides(slider.cloneNode(true)), { naturalWidth, naturalHeight } = slider.querySelector('img');
    copy.querySelector('button').remove();
    copy.style.width = `min(98vw, calc(96vh * ${naturalWidth / naturalHeight}))`;
    show(copy);
  };
  slides(slider).append(larger);
}

for (const map of document.querySelectorAll('.drawing')) {
  const groups = JSON.parse(map.dataset.groups);
  const cameras = [...map.querySelectorAll('.cam')];
  let chosen = -1, next = 0;
  for (const camera of cameras) camera.onclick = () => {
    const view = Number(camera.dataset.view);
    next = view === chosen ? next + 1 : 0;
    chosen = view;
    const group = groups.filter((members) => members.includes(view)).sort((a) => (a[0] === view ? -1 : 0))[next];
    map.classList.toggle('picking', Boolean(group));
    for (const other of cameras) {
      other.classList.toggle('picked', Boolean(group) && group.includes(Number(other.dataset.view)));
      other.classList.toggle('chosen', Boolean(group) && group[0] === Number(other.dataset.view));
    }
    if (!group) chosen = -1;
  };
}
"""
