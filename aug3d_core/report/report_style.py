"""The style sheets of pages: one column on a phone, pictures side by side on a laptop, light and dark."""

STYLE = """
:root{color-scheme:light dark;--bg:#f7f6f3;--card:#fff;--ink:#1d2327;--dim:#667078;--line:#e2e0da;--main:#1f6f8b;
--other:#c3ccd1;--good:#2b7a4b;--warn:#a8650b;--bad:#b3362b;--soft:#eef3f5}
@media(prefers-color-scheme:dark){:root{--bg:#14181b;--card:#1c2226;--ink:#e6e9eb;--dim:#98a3aa;--line:#2e363b;
--main:#5bb3d0;--other:#46525a;--good:#63c28a;--warn:#e0a04a;--bad:#ef7b70;--soft:#222a2f}}
*{box-sizing:border-box}
body{margin:0;background:var(--bg);color:var(--ink);font:16px/1.5 system-ui,-apple-system,"Segoe UI",Roboto,sans-serif}
main{max-width:1180px;margin:0 auto;padding:28px 20px 60px}
h1{font-size:2rem;line-height:1.15;margin:0}
h2{font-size:1.25rem;margin:44px 0 12px}
h3{font-size:1.02rem;margin:0 0 2px}
p{margin:6px 0}
.dim{color:var(--dim)}
.top{display:flex;flex-wrap:wrap;gap:10px 14px;align-items:center}
.badge{font-size:.8rem;font-weight:600;padding:2px 10px;border-radius:99px;border:1.5px solid currentColor}
.ok{color:var(--good)}.degraded{color:var(--warn)}.refused{color:var(--bad)}
.facts{display:flex;flex-wrap:wrap;gap:4px 22px;color:var(--dim);font-size:.92rem;margin:8px 0 20px}
.facts b{color:var(--ink);font-weight:600}
.card{background:var(--card);border:1px solid var(--line);border-radius:12px;padding:18px 20px}
.hero{display:grid;grid-template-columns:minmax(200px,1fr) minmax(0,2.4fr);gap:24px;align-items:center}
.big{font-size:3rem;font-weight:650;line-height:1;letter-spacing:-.02em;white-space:nowrap}
.big small{font-size:1.1rem;font-weight:500;color:var(--dim);letter-spacing:0}
.note{border-left:3px solid var(--warn);padding:2px 0 2px 12px;margin:8px 0}
.failure{border-color:var(--bad)}
.failure pre{white-space:pre-wrap;overflow-wrap:anywhere}
svg:not(.main-svg){width:100%;height:auto;display:block;font-family:inherit}
svg text{fill:var(--ink);font-size:14px}
svg .tick{fill:var(--dim);font-size:12px}
svg .value{fill:var(--dim)}svg .strong{font-weight:650;fill:var(--ink)}
.bar.main{fill:var(--main)}.bar.other{fill:var(--other)}
.whisker{stroke:var(--ink);stroke-width:1.6;fill:none}
.grid{stroke:var(--line);fill:none}path.line{stroke:var(--main);stroke-width:2;fill:none;stroke-linejoin:round}
.dot{fill:var(--main)}
.scroll{overflow-x:auto;background:var(--card);border:1px solid var(--line);border-radius:12px}
table{border-collapse:collapse;width:100%;font-size:.9rem}
th,td{padding:7px 12px;text-align:left;border-bottom:1px solid var(--line);white-space:nowrap}
th{color:var(--dim);font-weight:500;font-size:.82rem}
tr:last-child td{border-bottom:0}
.num{text-align:right;font-variant-numeric:tabular-nums}
td .share{display:inline-block;height:8px;border-radius:4px;background:var(--main);min-width:2px;vertical-align:middle}
.best{font-weight:650}
.curves{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,330px),1fr));gap:16px}
.stage{margin-top:18px}
.figures{display:flex;flex-wrap:wrap;gap:2px 18px;font-size:.86rem;color:var(--dim);margin:6px 0 12px}
.figures b{color:var(--ink);font-weight:550;font-variant-numeric:tabular-nums}
.pictures{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,400px),1fr));gap:16px;align-items:start}
figure{margin:0}
img{width:100%;height:auto;max-height:620px;object-fit:contain;object-position:left top;display:block;border-radius:6px}
video{width:100%;height:auto;display:block;border-radius:6px}
.slider{position:relative;--at:50%}
.slider img{border-radius:0;max-height:none}
.slider img+img{position:absolute;inset:0;clip-path:inset(0 calc(100% - var(--at)) 0 0)}
.slider input{position:absolute;inset:0;width:100%;height:100%;margin:0;opacity:0;cursor:ew-resize}
.slider input:focus-visible{opacity:.35}
.slider::after{content:"";position:absolute;top:0;bottom:0;left:var(--at);width:2px;margin-left:-1px;background:#fff;
pointer-events:none}
.slider span{position:absolute;top:6px;background:#0009;color:#fff;font-size:.78rem;padding:1px 7px;border-radius:9px;
pointer-events:none}
.slider .left{left:6px}.slider .right{right:6px}
figcaption{font-size:.86rem;color:var(--dim);margin-top:5px}
details{margin-top:8px}
summary{cursor:pointer;color:var(--dim);font-size:.92rem}
pre,code{font:.82rem/1.45 ui-monospace,SFMono-Regular,Menlo,Consolas,monospace}
pre{overflow-x:auto;background:var(--soft);padding:12px;border-radius:8px}
td code{overflow-wrap:anywhere}
@media screen and (max-width:700px){main{padding:18px 12px 40px}.hero{grid-template-columns:1fr;gap:14px}.card{padding:14px}
h1{font-size:1.6rem}.big{font-size:2.4rem}th,td{padding:6px 9px}}
@media print{@page{margin:12mm}html{font-size:11px}body{background:#fff;font-size:11px}main{max-width:none;padding:0}
h2{margin-top:24px}.card{padding:10px 12px}th,td{padding:3px 6px}.txt{white-space:normal}.scroll{overflow:visible}
figure,tr,li{break-inside:avoid}h2,h3{break-after:avoid}thead{display:table-header-group}
*{print-color-adjust:exact}}
.legend{display:flex;flex-wrap:wrap;gap:4px 18px;font-size:.88rem;margin:10px 0 0}
.scale{stroke:var(--ink);stroke-width:2.5;fill:none}
svg .scale-text{font-size:26px}.scale-back{fill:var(--card);opacity:.85}
"""

# What only the scene report has
REPORT_STYLE = """
:root{--g0:#4363d8;--g1:#3cb44b;--g2:#ffe119;--g3:#b245d6;--g4:#42d4f4;--g5:#9a6324;--g6:#bfef45;--g7:#f032e6;--g8:#008080;
--g9:#dcbeff;--gap:#9aa3a8;--target:#d7191c}
section{scroll-margin-top:52px}
section>.scroll,section>.card,section>.curves,section>.tables,section>.tall,section>.wrapped{margin:12px 0}
h3{margin-top:22px}.card h3{margin-top:0}
nav{position:sticky;top:0;z-index:2;display:flex;gap:2px 15px;overflow-x:auto;background:var(--bg);padding:9px 0;
border-bottom:1px solid var(--line);font-size:.9rem;white-space:nowrap}
nav a{color:var(--main);text-decoration:none;padding:2px 0}nav a:hover,nav a:focus{text-decoration:underline}
.note.ok{border-color:var(--main);color:inherit}.note.degraded{border-color:var(--warn);color:inherit}
.lights{list-style:none;margin:14px 0;display:grid;gap:0 34px;
grid-template-columns:repeat(auto-fit,minmax(min(100%,420px),1fr))}
.lights li{display:grid;grid-template-columns:4.6em 1fr auto;gap:0 10px;padding:6px 0;align-content:start;
border-bottom:1px solid var(--line)}
.lights b{font-weight:550}.lights .says{text-align:right;font-variant-numeric:tabular-nums}
.lights small{grid-column:2/4;color:var(--dim)}
.answer .lead{font-size:1.3rem;line-height:1.35;font-weight:550;margin:0 0 6px}
.answer .lights{grid-template-columns:1fr;margin:6px 0}
.answer .lights li{grid-template-columns:6.2em 1fr}.answer .lights small{grid-column:2}.answer h3{margin-top:18px}
.answer ul:not(.lights),.answer ol{margin:4px 0;padding-left:1.3em}.answer a{color:var(--main)}
.light{font-size:.82rem;font-weight:600;white-space:nowrap}
.light::before{content:"";display:inline-block;width:.75em;height:.75em;border-radius:50%;background:currentColor;margin-right:6px}
.good{color:var(--good)}.check{color:var(--warn)}.bad{color:var(--bad)}
.map svg{max-height:74vh;background:var(--soft);border-radius:6px}
.layers{display:flex;flex-wrap:wrap;gap:4px 18px;font-size:.88rem;margin:0 0 10px}
.layers label{cursor:pointer}
.key{display:inline-block;width:12px;height:12px;border-radius:50%;margin-right:6px;vertical-align:-1px;border:1px solid #0005}
.cam,.dome{r:var(--r)}.cam{stroke:#000;stroke-width:1.6;fill:#fff}.cam:hover{stroke:#fff;stroke-width:3}
.cam.g0{fill:var(--g0)}.cam.g1{fill:var(--g1)}.cam.g2{fill:var(--g2)}.cam.g3{fill:var(--g3)}.cam.g4{fill:var(--g4)}
.cam.g5{fill:var(--g5)}.cam.g6{fill:var(--g6)}.cam.g7{fill:var(--g7)}.cam.g8{fill:var(--g8)}.cam.g9{fill:var(--g9)}
.key.train{background:conic-gradient(var(--g0),var(--g2),var(--g1),var(--g6),var(--g3),var(--g7),var(--g0))}
.cam.gap,.cam.spare{fill:var(--gap);r:calc(.75*var(--r))}.cam.spare{fill-opacity:.4}.key.gap,.key.spare{background:var(--gap)}.key.spare{opacity:.4}.key.placed{background:#fff}
.cam.support{fill:#fff;stroke:#e07b00;stroke-width:3.5}.key.support{background:#fff;border:3px solid #e07b00}
.cam.target{fill:var(--target);stroke:#fff;stroke-width:3;r:calc(1.3*var(--r))}
.key.target{background:var(--target);border:2px solid #fff;box-shadow:0 0 0 1px #0006}
.map .look{stroke:#fff;stroke-width:1.4;fill:none;opacity:.75}
.point{fill:#ff4081;stroke:#fff;stroke-width:1.6}.point.check,.point.wrong{fill:#0008;stroke:#ff4081}
.point-key{border:0;border-radius:0;background:#ff4081;clip-path:polygon(50% 0,100% 100%,0 100%)}
.gps-error{stroke:#ffea00;stroke-width:2.4;fill:none}
.cell{fill:none;stroke:#fff;stroke-width:1.5;stroke-dasharray:7 6}.dome{fill:#00e5ff;stroke:#000;stroke-width:1.5}
.passed{stroke:#fff;stroke-width:2;fill:none;opacity:.8}
.virtual{stroke:#000;stroke-width:6;stroke-linecap:round;fill:none}
.domes .virtual{stroke:#00e5ff}
.picking .cam{opacity:.25}.picking .cam.picked{opacity:1}.picking .cam.chosen{stroke:#fff;stroke-width:4}
.map:has(.show-ground:not(:checked)) g.ground,.map:has(.show-looks:not(:checked)) g.looks,
.map:has(.show-domes:not(:checked)) g.domes,.map:has(.show-gps:not(:checked)) g.gps,
.map:has(.show-control:not(:checked)) g.control,
.map:has(.show-cams:not(:checked)) g.cams{display:none}
image{image-rendering:auto}
.tall .scroll{max-height:440px;overflow-y:auto}.tall thead th{position:sticky;top:0;background:var(--card)}
.tables{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,330px),1fr));gap:0 18px;align-items:start}
.wrapped td:last-child,.last-wraps td:last-child{white-space:normal;min-width:240px}.wrapped td{vertical-align:top}
.tables td:first-child,.halves td:first-child{white-space:normal}
.halves{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,440px),1fr));gap:16px;align-items:start}
section .pictures{display:block;columns:2 400px;column-gap:16px}.pictures figure{break-inside:avoid;margin-bottom:14px}
section .panels{columns:auto;display:grid}
.pictures .large{column-span:all;grid-column:1/-1}.pictures .large img{max-height:none}
.answer .lights{padding:0}.answer figure{max-width:420px;margin:6px 0}
.costs{display:grid;grid-template-columns:max-content 1fr 1fr;gap:5px 16px;align-items:center;font-size:.9rem}
.costs .head{color:var(--dim);font-size:.82rem}
.cost{display:flex;align-items:center;gap:8px;min-width:0}.cost small{white-space:nowrap;font-variant-numeric:tabular-nums}
.cost i{height:14px;border-radius:3px;min-width:2px;background:var(--main)}.cost .memory{background:var(--other)}
.curves svg,.wide svg{overflow:visible}
figure img{cursor:zoom-in}
.slider button{position:absolute;right:6px;bottom:6px;width:30px;height:30px;border:0;border-radius:6px;background:#0009;
color:#fff;font-size:17px;cursor:zoom-in}
dialog button{position:fixed;top:8px;right:8px;width:44px;height:44px;border:0;border-radius:50%;font-size:24px;
background:#000a;color:#fff;cursor:pointer}
dialog{border:0;padding:0;background:#000;max-width:100vw;max-height:100vh;overflow:auto}
dialog::backdrop{background:#000c}
dialog>img{width:98vw;height:96vh;max-height:none;object-position:center;cursor:zoom-in;border-radius:0}
dialog img.full{width:auto;height:auto;cursor:zoom-out}
@media screen and (max-width:700px){.cam,.dome{r:calc(1.7*var(--r))}
.cam.gap,.cam.spare{r:calc(1.3*var(--r))}.cam.target{r:calc(2.1*var(--r))}svg .scale-text{font-size:34px}
.curves svg text{font-size:15.5px}.wide svg text{font-size:18px}.virtual{stroke-width:9}
.costs{grid-template-columns:1fr 1fr;gap:2px 12px}.costs .name{grid-column:1/3;margin-top:6px}
.costs>span:first-child{display:none}.cost,.cost i{display:block}
.wrapped thead{display:none}.wrapped tr{display:block;padding:7px 12px;border-bottom:1px solid var(--line)}
.wrapped td{display:block;border:0;padding:1px 0;white-space:normal}}
@media print{nav,.layers,.slider input,.slider button,.slider::after,figure:has(video){display:none}
section>.card:not(.pictures,.answer),.curves>*,.slider{break-inside:avoid}
#answer{break-after:page}.answer details::details-content{content-visibility:visible;block-size:auto}
.tall .scroll{max-height:none}.tall thead th{position:static}
.slider{display:grid;grid-template-columns:1fr 1fr;gap:6px}.slider img+img{position:static;clip-path:none;order:-1}
.slider .right{right:auto;left:calc(50% + 9px)}section .pictures{columns:2 200px}
.curves,.halves,.hero{grid-template-columns:1fr 1fr}.map svg{max-height:none}}
"""
