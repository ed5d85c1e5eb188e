"""Rules of PDS4's core schema and Schematron for the labels written by polarsim: elements, words, identifiers.

No package contains the schema, so the rules for the classes used by polarsim are restated here: order and number of
elements from the Information Model 1.20 (docs/release/1K00/PDS4_PDS_1K00.xsd in NASA-PDS' repository
pds4-information-model), and assertions of the Schematron 1.4, which are unchanged in later versions. This does not
replace a validation by the PDS: other classes and the types of values are not checked.
"""

import re
from collections.abc import Iterator
from xml.etree import ElementTree

PDS = "{http://pds.nasa.gov/pds4/pds/v1}"
# A class per line with the ordered elements; ? optional, + at least 1, * any number.
ORDER = """
Product_Observational: Identification_Area Reference_List? Observation_Area File_Area_Observational+
Product_Browse: Identification_Area Reference_List? File_Area_Browse+
Product_Document: Identification_Area Context_Area? Reference_List? Document
Product_Collection: Identification_Area Context_Area? Reference_List? Collection File_Area_Inventory
Product_Bundle: Identification_Area Context_Area? Reference_List? Bundle File_Area_Text? Bundle_Member_Entry+
Identification_Area: logical_identifier version_id title information_model_version product_class Alias_List? \
    Citation_Information? Modification_History?
Citation_Information: author_list? editor_list? publication_year doi? keyword* description
Context_Area: comment? Time_Coordinates? Primary_Result_Summary? Investigation_Area* Observing_System* \
    Target_Identification* Mission_Area? Discipline_Area?
Observation_Area: comment? Time_Coordinates Primary_Result_Summary? Investigation_Area+ Observing_System+ \
    Target_Identification+ Mission_Area? Discipline_Area?
Time_Coordinates: start_date_time stop_date_time
Primary_Result_Summary: type? purpose+ data_regime* processing_level+ processing_level_id? description? \
    Science_Facets*
Investigation_Area: name type Internal_Reference+
Internal_Reference: lid_reference reference_type comment?
Observing_System: name? description? Observing_System_Component+
Observing_System_Component: name type description? Internal_Reference? External_Reference*
Target_Identification: name alternate_designation* type+ description? Internal_Reference?
File_Area_Observational: File (Array_2D_Image|Array_3D_Image|Table_Delimited)+
File_Area_Browse: File Encoded_Image+
File_Area_Inventory: File Inventory
File: file_name local_identifier? creation_date_time? file_size? records? md5_checksum? comment?
Array_2D_Image: name? local_identifier? md5_checksum? offset axes axis_index_order description? Element_Array \
    Axis_Array Axis_Array Special_Constants?
Array_3D_Image: name? local_identifier? md5_checksum? offset axes axis_index_order description? Element_Array \
    Axis_Array Axis_Array Axis_Array Special_Constants?
Element_Array: data_type unit? scaling_factor? value_offset?
Axis_Array: axis_name local_identifier? elements unit? sequence_number
Table_Delimited: name? local_identifier? md5_checksum? offset object_length? parsing_standard_id description? records \
    record_delimiter field_delimiter Record_Delimited
Inventory: name? local_identifier? md5_checksum? offset object_length? parsing_standard_id description? records \
    record_delimiter field_delimiter Record_Delimited reference_type
Record_Delimited: fields groups maximum_record_length? Field_Delimited+
Field_Delimited: name local_identifier? field_number data_type maximum_field_length? field_format? unit? \
    scaling_factor? value_offset? description? Special_Constants?
Special_Constants: saturated_constant? missing_constant?
Encoded_Image: name? local_identifier? md5_checksum? offset object_length? encoding_standard_id description?
Document: revision_id? document_name? doi? author_list? editor_list? acknowledgement_text? copyright? \
    publication_date document_editions? description? Document_Edition+
Document_Edition: edition_name starting_point_identifier? language files description? Document_File+
Document_File: file_name local_identifier? file_size? md5_checksum? directory_path_name? document_standard_id
Collection: collection_type description?
Bundle: bundle_type description?
Bundle_Member_Entry: lid_reference member_status reference_type
"""
# Allowed values by class and element.
WORDS = {
    "Primary_Result_Summary/purpose": "Calibration Checkout Engineering Navigation Science",
    "Primary_Result_Summary/processing_level": "Calibrated Derived Raw Telemetry",
    "Observing_System_Component/type": "Host Instrument Laboratory Observatory Spacecraft Telescope",
    "Internal_Reference/reference_type": "data_to_investigation",
    "Collection/collection_type": "Browse Calibration Context Data Document Geometry Miscellaneous",
    "Bundle/bundle_type": "Archive Supplemental",
    "Bundle_Member_Entry/member_status": "Primary Secondary",
    "Bundle_Member_Entry/reference_type": "bundle_has_browse_collection bundle_has_data_collection "
    "bundle_has_document_collection",
    "Inventory/reference_type": "inventory_has_member_product",
    "Encoded_Image/encoding_standard_id": "GIF JPEG PNG TIFF",
    "Element_Array/data_type": "UnsignedByte UnsignedMSB2 IEEE754MSBSingle",
    "Field_Delimited/data_type": "ASCII_Boolean ASCII_Integer ASCII_Real ASCII_String ASCII_LIDVID_LID UTF8_String",
}
_COLONS = {"Product_Bundle": 3, "Product_Collection": 4}  # number of colons in an identifier; 5 in other products
_CITED = ("Product_Bundle", "Product_Collection", "Product_Document")


def _patterns() -> dict[str, re.Pattern[str]]:
    lines = ORDER.replace("\\\n", "").strip().splitlines()
    patterns = {}
    for line in lines:
        name, _, parts = line.partition(":")
        tags = [re.fullmatch(r"(.*?)([?+*]?)", part).groups() for part in parts.split()]
        patterns[name] = re.compile("".join(f"(?:(?:{tag}) ){count}" for tag, count in tags))
    return patterns


PATTERNS = _patterns()


def broken_rules(label: bytes) -> Iterator[str]:
    """Yield a description of each rule that a label violates."""
    root = ElementTree.fromstring(label)
    for element in root.iter():
        name = element.tag.removeprefix(PDS)
        if len(element):
            children = "".join(f"{child.tag.removeprefix(PDS)} " for child in element)
            if name not in PATTERNS:
                yield f"{name} is an unknown class"
            elif not PATTERNS[name].fullmatch(children):
                yield f"{name} contains {children}"
        for child in element:
            words = WORDS.get(f"{name}/{child.tag.removeprefix(PDS)}")
            if words and child.text not in words.split():
                yield f"{name}: {child.tag.removeprefix(PDS)} is {child.text!r}"
        if name in ("offset", "file_size", "maximum_field_length") and element.get("unit") != "byte":
            yield f"{name} without unit"
    yield from _broken_identity(root)
    yield from _broken_records(root)
    yield from _broken_axes(root)


def _broken_identity(root: ElementTree.Element) -> Iterator[str]:
    kind, area = root.tag.removeprefix(PDS), root.find(f"{PDS}Identification_Area")
    lid = area.findtext(f"{PDS}logical_identifier")
    if (
        lid.startswith("urn:nasa:")
        or not re.fullmatch(r"urn(:[a-z0-9._-]+)+", lid)
        or lid.count(":") != _COLONS.get(kind, 5)
    ):
        yield f"logical_identifier {lid}"
    if area.findtext(f"{PDS}product_class") != kind:
        yield "product_class differs from the root element"
    if kind in _CITED and not area.findtext(f"{PDS}Citation_Information/{PDS}description"):
        yield "Citation_Information and its description are required"
    for text in (element for name in ("title", "name") for element in root.iter(f"{PDS}{name}")):
        if not 0 < len(text.text or "") <= 255:
            yield f"{text.text!r} has not 1 to 255 characters"


def _broken_records(root: ElementTree.Element) -> Iterator[str]:
    for record in root.iter(f"{PDS}Record_Delimited"):
        fields = record.findall(f"{PDS}Field_Delimited")
        if record.findtext(f"{PDS}fields") != str(len(fields)) or record.findtext(f"{PDS}groups") != "0":
            yield "number of fields is wrong"
        numbers = [field.findtext(f"{PDS}field_number") for field in fields]
        if numbers != [str(number) for number in range(1, len(fields) + 1)]:
            yield "fields are not numbered from 1"
    for inventory in root.iter(f"{PDS}Inventory"):
        fields = list(inventory.iter(f"{PDS}Field_Delimited"))
        names = [(field.findtext(f"{PDS}name"), field.findtext(f"{PDS}data_type")) for field in fields]
        if names != [("Member_Status", "ASCII_String"), ("LIDVID_LID", "ASCII_LIDVID_LID")]:
            yield "an inventory needs Member_Status and LIDVID_LID"
        elif fields[0].findtext(f"{PDS}maximum_field_length") != "1":
            yield "Member_Status has a single letter"


def _broken_axes(root: ElementTree.Element) -> Iterator[str]:
    for image in (*root.iter(f"{PDS}Array_2D_Image"), *root.iter(f"{PDS}Array_3D_Image")):
        axes = image.findall(f"{PDS}Axis_Array")
        if [axis.findtext(f"{PDS}axis_name") for axis in axes][-2:] != ["Line", "Sample"]:
            yield "axes are not Line and Sample"
        if [axis.findtext(f"{PDS}sequence_number") for axis in axes] != [str(n + 1) for n in range(len(axes))]:
            yield "axes are not numbered from 1"
        if image.findtext(f"{PDS}axes") != str(len(axes)):
            yield "number of axes is wrong"
