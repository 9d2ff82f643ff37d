"""The report as one HTML file that includes its pictures."""

import base64
import re
from collections.abc import Mapping

_STYLE = """\
body { font: 16px/1.5 system-ui, sans-serif; color: #222; max-width: 72rem; margin: 2rem auto; padding: 0 1rem }
img { max-width: 100% } h1, h2, h3 { line-height: 1.2 } h2 { margin-top: 2.5rem }
.wide { overflow-x: auto } table { border-collapse: collapse; font-size: 0.85rem; white-space: nowrap }
th, td { padding: 0.2rem 0.6rem; border-bottom: 1px solid #ddd } th { background: #f4f4f4 }
tr:hover { background: #fafafa }
td strong { color: #b00020 }"""


def as_page(markdown_text: str, pictures: Mapping[str, bytes]) -> str:
    """report.html: the Markdown and its pictures in one file. Wide tables have their own scroll bar."""
    from markdown import markdown

    body = markdown(markdown_text, extensions=["tables"])
    for name, content in pictures.items():
        data = base64.b64encode(content).decode()
        body = body.replace(f'src="{name}"', f'src="data:image/png;base64,{data}"')
    body = body.replace("<table>", '<div class="wide"><table>').replace("</table>", "</table></div>")
    heading = re.search(r"<h1>(.*?)</h1>", body)
    title = heading.group(1) if heading else "jaxrot"
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>\n'
        f'<meta name="viewport" content="width=device-width"><style>\n{_STYLE}\n</style></head>\n<body>\n{body}\n'
        "</body></html>\n"
    )
