"""The report's style sheet: one column on a phone, pictures side by side on a laptop, light and dark."""

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
svg{width:100%;height:auto;display:block;font-family:inherit}
svg text{fill:var(--ink);font-size:14px}
svg .tick{fill:var(--dim);font-size:12px}
svg .value{fill:var(--dim)}svg .strong{font-weight:650;fill:var(--ink)}
.bar.main{fill:var(--main)}.bar.other{fill:var(--other)}
.whisker{stroke:var(--ink);stroke-width:1.6;fill:none}
.grid{stroke:var(--line);fill:none}.line{stroke:var(--main);stroke-width:2;fill:none;stroke-linejoin:round}
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
img{width:100%;max-height:620px;object-fit:contain;object-position:left top;display:block;border-radius:6px}
figcaption{font-size:.86rem;color:var(--dim);margin-top:5px}
details{margin-top:8px}
summary{cursor:pointer;color:var(--dim);font-size:.92rem}
pre,code{font:.82rem/1.45 ui-monospace,SFMono-Regular,Menlo,Consolas,monospace}
pre{overflow-x:auto;background:var(--soft);padding:12px;border-radius:8px}
td code{overflow-wrap:anywhere}
@media(max-width:700px){main{padding:18px 12px 40px}.hero{grid-template-columns:1fr;gap:14px}.card{padding:14px}
h1{font-size:1.6rem}.big{font-size:2.4rem}th,td{padding:6px 9px}.wide svg text{font-size:16px}}
@media print{body{background:#fff}.card,.scroll,figure{break-inside:avoid}}
"""
